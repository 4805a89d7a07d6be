"""The text of a `rig.yaml`: what was found, what is usual, and where to read about the rest."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.camera import CameraFound
from drivers.discovery import Kind, PortFound

_HEAD = """\
# What is plugged in, as trackside devices found it. Every key: docs/car.md and docs/formats.md.
# Leave out a block and that device is not recorded.
format: 1

recording:
  folder: sessions
  disk_reserve_mb: 500     # a recording ends when less room is left
  still_s: 2.0             # the car stands at the start, for the bias of the gyro
  # clock_server: LAPTOP   # where trackside clock serve runs: asked at start and end
"""

_VESC_CALIBRATION = """\

# Of this car: trackside calibrate odometry measures them. These are f1tenth's defaults.
vesc_calibration:
  speed_to_erpm_gain: 4614.0               # ERPM for each m/s
  steering_angle_to_servo_gain: -1.2135    # servo value for each rad, counter-clockwise
  steering_angle_to_servo_offset: 0.5304   # servo value at which it goes straight
  wheelbase_m: 0.325
  direction: 1                             # -1 where the counts go down when it drives forward
"""

_LINES: dict[Kind, str] = {
    "lidar": "  rotation_hz: 10.0\n",
    "vesc": "  rate_hz: 50.0\n",
    "razor": "",
}


def rig_text(
    ports: Sequence[PortFound], cameras: Sequence[CameraFound], i2c_bus: str | None = None
) -> str:
    """A rig of all that answered; what could be two devices of one kind is left as a comment."""
    parts = [_HEAD]
    taken: set[str] = set()
    for port in ports:
        if port.kind is not None:
            parts.append(_device(port, port.kind, again=port.kind in taken))
            taken.add(port.kind)
    if "vesc" in taken:
        parts.append(_VESC_CALIBRATION)
    if i2c_bus is not None and "razor" not in taken:
        parts.append(f"\nmpu9250:\n  bus: {i2c_bus}\n  rate_hz: 200\n")
    parts += [_camera(camera, taken) for camera in cameras if camera.problem is None]
    return "".join(parts)


def _device(port: PortFound, kind: Kind, *, again: bool) -> str:
    told = ", ".join(f"{key} {value}" for key, value in port.identity.items())
    text = f"{kind}:\n  port: {port.path}     # {told}\n{_LINES[kind]}"
    return "\n" + (_commented(text) if again else text)


def _camera(camera: CameraFound, taken: set[str]) -> str:
    """A camera; the first that is no ZED is taken for the one above the track."""
    is_zed = (camera.usb_id or "").startswith("2b03:")
    name = "zed" if is_zed else "overhead"
    text = f"{name}:\n  path: {camera.path}     # {camera.card or 'camera'}\n"
    if not is_zed:
        text += "  width_px: 1920\n  height_px: 1080\n  rate_hz: 30.0\n"
        text += (
            "  # exposure_s: 0.005      # fixed, so that the frame rate does not fall in the dark\n"
        )
    again = name in taken
    taken.add(name)
    return "\n" + (_commented(text) if again else text)


def _commented(text: str) -> str:
    return "".join(f"# {line}\n" for line in text.splitlines())
