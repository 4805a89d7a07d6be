"""Odometry that was made of a recording later: in a log of its own, so that no other is touched."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from capture.errors import SessionError
from capture.log_columns import LOST_COVARIANCE
from capture.log_writer import LogWriter
from capture.messages import odometry_messages
from capture.session_writer import write_rosbag_metadata, written_topics
from capture.streams import UncertainOdometry
from capture.topics import ODOMETRY_TYPE, odometry_topic
from geometry import Floats

if TYPE_CHECKING:
    from capture.session import Session

_PLANAR = (0, 1, 5)
"""Rows of x, y and heading in ROS' six: x, y, z, roll, pitch, yaw."""
_ON_THE_FLOOR = 1e-6
"""Variance of what a car on a floor does not do."""


def add_odometry(session: Session, told: UncertainOdometry, *, replace: bool) -> Path:
    """Write `SOURCE.mcap` into a session, whole or not at all, and list it for ROS tools.

    Where the source was lost it repeats its pose with a covariance of 9999, as libviso2 does.
    Raises `SessionError` if the source is there and may not be replaced, `LogError` when the disk
    does not take it.
    """
    source = told.odometry.source
    file, topic = session.folder / f"{source}.mcap", odometry_topic(source)
    if source in session.odometry_sources and not file.exists():
        raise SessionError(
            f"{session.folder}: its recording has {topic} already, which is never changed; use "
            f"that (trackside slam --odometry {source})"
        )
    if file.exists() and not replace:
        raise SessionError(f"{file} exists already; give --replace to make it anew")
    partial = file.with_name(f".{file.name}.partial-{os.getpid()}")
    try:
        with LogWriter(partial, sync_period_s=None) as log:
            for t_ns, data in zip(*_messages(told), strict=True):
                log.write(topic, ODOMETRY_TYPE, data, log_t_ns=t_ns, stamp_ns=t_ns)
        partial.replace(file)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
    if (session.folder / "metadata.yaml").exists():  # a broken session gets one by recovering it
        logs = type(session).open(session.folder).logs
        write_rosbag_metadata(session.folder, {log.file.name: written_topics(log) for log in logs})
    return file


def _messages(told: UncertainOdometry) -> tuple[list[int], list[bytes]]:
    """Samples and lost messages in the order of their stamps."""
    known = told.odometry
    t_ns = np.union1d(known.t_ns, known.lost_t_ns)
    row = np.maximum(np.searchsorted(known.t_ns, t_ns, side="right") - 1, 0)
    lost = ~np.isin(t_ns, known.t_ns)
    whole = replaced(
        known,
        t_ns=t_ns,
        pose_odom_base=known.pose_odom_base[row],
        speed_m_s=np.where(lost, 0.0, known.speed_m_s[row]),
        yaw_rate_rad_s=np.where(lost, 0.0, known.yaw_rate_rad_s[row]),
        lost_t_ns=t_ns[:0],
    )
    covariances = [
        np.where(lost[:, None], LOST_COVARIANCE * np.eye(6).ravel(), _in_space(planar[row]))
        for planar in (told.pose_covariance, told.twist_covariance)
    ]
    return t_ns.tolist(), odometry_messages(whole, *covariances)


def _in_space(planar: Floats) -> Floats:
    """(n, 36) of (n, 3, 3)."""
    whole = np.zeros((len(planar), 6, 6))
    whole[:, range(6), range(6)] = _ON_THE_FLOOR
    whole[np.ix_(range(len(planar)), _PLANAR, _PLANAR)] = planar
    return whole.reshape(-1, 36)
