"""What a recording of the full rig holds, against what the devices sent and when it was true."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from full_rig import (
    LIDAR_SAMPLES,
    Emulated,
    Errors,
    gyro_error_s,
    tachometer_error_s,
    time_in_image,
)

from capture.clock import UtcLine
from capture.messages import typestore
from capture.point_cloud import point_cloud_columns
from capture.recording.ledger import SELF
from capture.sensor_messages import diagnostics_of, raw_bytes
from capture.session import Session
from capture.topics import (
    DIAGNOSTICS_TOPIC,
    IMAGE_TYPE,
    OVERHEAD_TOPIC,
    POINTS_TOPIC,
    RAW_IMU_TOPIC,
    RAW_LIDAR_TOPIC,
    RAW_VESC_TOPIC,
)
from drivers import Counters
from drivers.imu.mpu9250 import Mpu9250Decoder
from drivers.port import Chunk
from drivers.rplidar import RevolutionSplitter, UltraDecoder

US_Q8 = 127 * 256
INDEX_NS = US_Q8 * 125 / 32
TAIL_BYTES = 4096
"""What a device may have sent after we were asked to stop."""


@dataclass(frozen=True)
class Audit:
    """One stream: messages held, pieces that the device sent and the log lacks, stamp errors.

    The errors are those from the start of the recording on, when every device gave something; the
    pieces are counted from the first byte.
    """

    name: str
    messages: int
    missing: int
    error_s: Errors

    @property
    def jitter_s(self) -> float:
        """One sigma of the stamps about the true times."""
        return float(np.std(self.error_s))

    @property
    def bias_s(self) -> float:
        """Mean of the stamps against the true times."""
        return float(np.mean(self.error_s))


def audited(folder: Path, emulated: Emulated) -> list[Audit]:
    """Every stream of a recording."""
    session = Session.open(folder)
    pair = session.info.clocks[0]
    utc = UtcLine(pair.monotonic_ns, pair.utc_ns)
    found = [_lidar(session, emulated, utc), _vesc(session, emulated, utc), _imu(session, utc)]
    overhead = [log for log in session.logs if log.file.name == "overhead.mcap"]
    return [*found, *(_camera(log, utc) for log in overhead)]


def _start_ns(session: Session) -> int:
    """Since when the recording counts: every device gave something then."""
    assert session.log is not None
    last = session.log.read(DIAGNOSTICS_TOPIC).messages[-1]
    return int(diagnostics_of(last)[SELF]["started_ns"])


def _raw(session: Session, topic: str) -> bytes:
    assert session.log is not None
    return b"".join(raw_bytes(message) for message in session.log.read(topic).messages)


def missing_bytes(held: bytes, sent: bytes) -> int:
    """Bytes that were sent and are not held, but for what was sent after the end."""
    start = sent.find(held[:64])
    if start < 0 or sent[start : start + len(held)] != held:
        return len(sent)
    after = len(sent) - start - len(held)
    return after if after > TAIL_BYTES else 0


def _lidar(session: Session, emulated: Emulated, utc: UtcLine) -> Audit:
    assert session.log is not None
    held = _raw(session, RAW_LIDAR_TOPIC)
    missing = missing_bytes(held, emulated.sent["lidar"])
    turns = RevolutionSplitter(US_Q8).feed(UltraDecoder().feed(held))
    first, last = emulated.lidar_true_ns
    true_ns = [first + turn.device_ns / INDEX_NS * (last - first) / LIDAR_SAMPLES for turn in turns]
    starts_ns = np.array([times[0] for times in true_ns])
    scans = point_cloud_columns(session.log.read(POINTS_TOPIC))
    errors = []
    for k in np.flatnonzero(scans.t_ns >= _start_ns(session)).tolist():
        stamps = scans.beam_t_ns[scans.starts[k] : scans.starts[k + 1]] - utc.utc(0)
        nearest = int(np.abs(starts_ns - stamps[0]).argmin())
        # A turn that was torn while recording is whole in the raw bytes: then lengths may differ.
        if len(true_ns[nearest]) == len(stamps):
            errors.append((stamps - true_ns[nearest]) * 1e-9)
    return Audit("lidar", len(scans.t_ns), missing, np.concatenate(errors))


def _vesc(session: Session, emulated: Emulated, utc: UtcLine) -> Audit:
    missing = missing_bytes(_raw(session, RAW_VESC_TOPIC), emulated.sent["vesc"])
    states, start_ns = session.vesc_state(), _start_ns(session)
    pairs = zip(states.t_ns.tolist(), states.tachometer.tolist(), strict=True)
    errors = np.array(
        [tachometer_error_s(t_ns, int(counts), utc) for t_ns, counts in pairs if t_ns >= start_ns]
    )
    return Audit("vesc", states.t_ns.size, missing, errors)


def _imu(session: Session, utc: UtcLine) -> Audit:
    """The samples in the raw bytes and those in the log; the device's own count has no hole."""
    assert session.log is not None
    raw = session.log.read(RAW_IMU_TOPIC)
    counters = Counters()
    decoder = Mpu9250Decoder(counters)
    samples = [
        sample
        for t_ns, message in zip(raw.log_t_ns.tolist(), raw.messages, strict=True)
        for sample in decoder.feed(Chunk(t_ns, raw_bytes(message))).samples
    ]
    imu = session.imu()
    # The device's count begins anew after an overflow, whose losses the driver counts itself.
    steps = np.diff([sample.device_ns for sample in samples]) // 5_000_000
    same_epoch = np.diff([sample.epoch for sample in samples]) == 0
    holes = int((steps[same_epoch] - 1).sum())
    missing = counters.lost_samples + holes + len(samples) - imu.t_ns.size
    rates, start_ns = imu.angular_velocity_rad_s[:, 2], _start_ns(session)
    pairs = zip(imu.t_ns.tolist(), rates.tolist(), strict=True)
    errors = np.array([gyro_error_s(t_ns, rate, utc) for t_ns, rate in pairs if t_ns >= start_ns])
    return Audit("mpu9250", imu.t_ns.size, missing, errors)


def _camera(log: Any, utc: UtcLine) -> Audit:
    times, errors = [], []
    for message in log.messages():
        if message.topic == OVERHEAD_TOPIC:
            image: Any = typestore().deserialize_cdr(message.data, IMAGE_TYPE)
            true_ns = time_in_image(bytes(image.data[:16]))
            times.append(true_ns)
            errors.append((message.stamp_ns - utc.utc(0) - true_ns) * 1e-9)
    periods = np.rint(np.diff(times) / (1e9 / 30.0)).astype(int)
    return Audit("overhead", len(times), int((periods - 1).sum()), np.array(errors))
