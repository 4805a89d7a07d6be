"""From a rig and the words of a person to a recorder with a folder of its own."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from capture.clock import UtcLine, read_clock_pair
from capture.network_clock import read_boot_id
from capture.recording.clock_witness import ClockWitness
from capture.recording.folder import new_recording_folder
from capture.recording.recorder import Clocks, Limits, Recorder
from capture.recording.rig import Rig
from capture.recording.rig_streams import streams_of
from capture.session_info import SessionInfo
from capture.yaml_file import plain
from dialogue import UsageError, nearest_names


@dataclass(frozen=True)
class Take:
    """What is driven: the map and the power as the thesis names them, the trial (None: counted)."""

    map: str
    power: str = ""
    trial: int | None = None
    notes: str = ""


def devices_of(rig: Rig, among: Sequence[str], without: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the devices to record; raises `UsageError` when none is left, or for wrong names."""
    here = [name for name in among if rig.has(name)]
    for name in without:
        if name not in here:
            hint = nearest_names(name, here) if here else "the rig has none of these"
            raise UsageError(f"--without {name}: no such device in the rig; {hint}")
    left = tuple(name for name in here if name not in without)
    if not left:
        raise UsageError(
            f"there is nothing to record: the rig names none of {', '.join(among)}"
            + (" besides those left out" if without else "; see trackside devices")
        )
    return left


def recorder_for(
    rig: Rig,
    names: Sequence[str],
    take: Take,
    *,
    base: Path | None = None,
    suffix: str = "",
    seconds: float | None = None,
    clocks: Clocks = Clocks(),  # noqa: B008  frozen
) -> Recorder:
    """A recorder of these devices in a new folder; nothing is opened yet.

    Raises `UsageError`, `SessionError` or `LogError` where the folder cannot be.
    """
    pair = read_clock_pair(clocks.monotonic_ns, clocks.utc_ns)
    utc = UtcLine(pair.monotonic_ns, pair.utc_ns)
    streams = streams_of(rig, names, utc)
    started = datetime.datetime.fromtimestamp(pair.utc_ns * 1e-9, datetime.timezone.utc)
    folder, trial = new_recording_folder(
        base or Path(rig.recording.folder), started.date(), take.map, take.power, take.trial, suffix
    )
    info = SessionInfo(
        map=take.map,
        power=take.power,
        trial=trial,
        notes=take.notes,
        start_utc=started.isoformat(timespec="seconds"),
        clocks=(pair,),
        boot_id=read_boot_id(),
        configuration={"rig": cast("dict[str, object]", plain(rig))},
    )
    limits = Limits(seconds, rig.recording.still_s, rig.recording.disk_reserve_mb * 1_000_000)
    return Recorder(
        folder, info, streams, utc, limits, clocks, ClockWitness(rig.recording.clock_server)
    )
