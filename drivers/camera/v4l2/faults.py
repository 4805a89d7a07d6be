"""The system's refusals, and what a person does about each."""

from __future__ import annotations

import errno

from drivers.camera.v4l2.config import V4l2Config
from drivers.camera.v4l2.source import DeviceFacts
from drivers.errors import (
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    NoAnswerError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
)

USB2_MBIT_S = 480


def opening_error(path: str, err: OSError) -> PortError:
    """Why a path could not be opened as a camera."""
    if err.errno in (errno.EACCES, errno.EPERM):
        return PortDeniedError(
            f"{path}: no permission for this camera; add yourself to its group "
            "(sudo usermod -aG video $USER, then log in again) or install the udev rules "
            "(docs/car.md)"
        )
    if err.errno == errno.EBUSY:
        return busy_error(path)
    if err.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return PortMissingError(
            f"{path}: no camera is plugged in there; check its cable, then see trackside devices "
            "for the cameras there are"
        )
    if err.errno in (errno.ENOTTY, errno.EINVAL, errno.ENOTSUP):
        return PortError(f"{path}: is no video device; see trackside devices for the cameras")
    return PortError(f"{path}: cannot be opened as a camera: {err}; see trackside devices")


def busy_error(path: str) -> PortBusyError:
    """Another program streams from the camera."""
    return PortBusyError(
        f"{path}: another program uses this camera; stop that program (fuser -v {path} names it: "
        "a browser, a meeting, a preview window)"
    )


def not_capturing_error(path: str, facts: DeviceFacts) -> PortError:
    """A node that gives no pictures."""
    return PortError(
        f"{path}: this node of {facts.card} gives no video (a camera has a second node for "
        "metadata); take the one that ends in -video-index0 (trackside devices lists them)"
    )


def mode_error(config: V4l2Config, facts: DeviceFacts, err: OSError) -> DriverError:
    """The format, the rate or a control was refused with a number of the system's."""
    if err.errno == errno.EBUSY:
        return busy_error(config.path)
    if err.errno in (errno.ENODEV, errno.EBADF):
        return lost_error(config.path, err)
    return DeviceFaultError(
        f"{config.path}: {facts.card} refuses {mode_text(config)}: {err}; "
        "see trackside devices for the modes it offers"
    )


def start_error(config: V4l2Config, facts: DeviceFacts, err: OSError) -> DriverError:
    """The stream did not start."""
    if err.errno == errno.EBUSY:
        return busy_error(config.path)
    if err.errno in (errno.ENODEV, errno.EBADF):
        return lost_error(config.path, err)
    if err.errno == errno.ENOSPC:
        return DeviceFaultError(
            f"{config.path}: the USB bus has no room left for {mode_text(config)} of {facts.card}"
            f"{bus_hint(config, facts)}; put the camera on a port of its own (not behind the hub of"
            " another camera), or ask for MJPG, a smaller size or a lower frame rate"
        )
    return DeviceFaultError(
        f"{config.path}: {facts.card} does not start to stream {mode_text(config)}: {err}; "
        "plug it out and in again and look at dmesg"
    )


def silent_error(config: V4l2Config, facts: DeviceFacts, waited_s: float) -> NoAnswerError:
    """Streaming, as the driver says, but no frame comes."""
    return NoAnswerError(
        f"{config.path}: no frame from {facts.card} within {waited_s:.1f} s of the start of "
        f"{mode_text(config)}{bus_hint(config, facts)}; plug it out and in again, try another "
        "cable or port, or a smaller mode"
    )


def lost_error(path: str, err: OSError | None, silence_s: float = 0.0) -> DeviceLostError:
    """A camera that gave frames and does not any more."""
    why = f"({err})" if err else f"(no frame for {silence_s:.1f} s)"
    return DeviceLostError(
        f"{path}: the camera is gone {why}; check its cable and port, plug it in again"
    )


def mode_text(config: V4l2Config) -> str:
    """The asked mode in words: `1920 x 1080 MJPG at 30 Hz`."""
    return f"{config.width_px} x {config.height_px} {config.fourcc} at {config.rate_hz:g} Hz"


def bus_hint(config: V4l2Config, facts: DeviceFacts) -> str:
    """What the mode asks of the port and what the port gives, where either is known."""
    parts = []
    if config.frame_bytes is not None:
        parts.append(f"the mode needs {config.frame_bytes * config.rate_hz / 1e6:.0f} MB/s")
    if facts.usb_mbit_s is not None:
        kind = "USB 3" if facts.usb_mbit_s > USB2_MBIT_S else "USB 2"
        parts.append(f"its port runs at {facts.usb_mbit_s:g} Mbit/s, {kind}")
    return f" ({'; '.join(parts)})" if parts else ""
