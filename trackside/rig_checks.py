"""What of a rig would keep it from recording: ports, permissions, packages, cameras, buses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dialogue import TracksideError
from trackside.finding import Finding

if TYPE_CHECKING:
    from capture.recording.rig import Rig


def rig_findings(file: Path) -> tuple[list[Finding], Rig | None]:
    """Whether the rig can be read, and whether each of its devices can be opened; none is started.

    None instead of the rig where the file has faults.
    """
    from capture.recording.rig import read_rig

    try:
        rig = read_rig(file)
    except TracksideError as err:
        return [Finding("rig", False, str(err), "mend the file")], None
    findings = [Finding("rig", True, f"{file} is read")]
    ports = {"lidar": rig.lidar, "vesc": rig.vesc, "razor": rig.razor}
    findings += [_port(name, config.port) for name, config in ports.items() if config is not None]
    if rig.mpu9250 is not None:
        findings.append(_bus(rig.mpu9250.bus))
    cameras = {"zed": rig.zed, "overhead": rig.overhead}
    findings += [_camera(name, config.path) for name, config in cameras.items() if config]
    return findings, rig


def _port(name: str, path: str) -> Finding:
    """Open and close it: nothing is sent."""
    from drivers import SerialPort

    try:
        SerialPort(path, dtr=False).close()
    except TracksideError as err:
        return _refused(name, err)
    return Finding(name, True, f"{path} can be opened")


def _bus(path: str) -> Finding:
    from drivers.imu.mpu9250 import SmbusBus

    try:
        SmbusBus(path).close()
    except TracksideError as err:
        return _refused("mpu9250", err)
    return Finding("mpu9250", True, f"{path} can be opened")


def _camera(name: str, path: str) -> Finding:
    """A camera is opened and asked for its name; no stream is started."""
    from drivers.camera.v4l2.driver import open_linux
    from drivers.camera.v4l2.faults import opening_error

    try:
        open_linux(path).close()
    except TracksideError as err:
        return _refused(name, err)
    except OSError as err:
        return _refused(name, opening_error(path, err))
    return Finding(name, True, f"{path} can be opened")


def _refused(name: str, err: TracksideError) -> Finding:
    """The error's own text holds what to do, after its last semicolon."""
    seen, _, remedy = str(err).rpartition("; ")
    return Finding(name, False, seen or remedy, remedy if seen else "")
