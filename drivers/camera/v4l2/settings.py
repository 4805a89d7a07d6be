"""Asking a camera for its mode and settings, and reading back what it made of them."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from drivers.camera.v4l2.config import FRAME_FORMATS, V4l2Config
from drivers.camera.v4l2.faults import bus_hint, mode_text
from drivers.camera.v4l2.source import (
    EXPOSURE_APERTURE_PRIORITY,
    EXPOSURE_AUTOMATIC,
    EXPOSURE_MANUAL,
    EXPOSURE_UNIT_NS,
    Control,
    DeviceFacts,
    VideoMode,
    VideoSource,
)
from drivers.errors import DeviceFaultError

POWER_LINE = {0: 0, 50: 1, 60: 2}
"""`POWER_LINE_FREQUENCY` by the mains' frequency."""


@dataclass(frozen=True)
class Wish:
    """A value for a control; needed : whether a camera without that control is refused."""

    control: Control
    value: int
    needed: bool


def wishes(config: V4l2Config) -> tuple[Wish, ...]:
    """The controls to be set, in an order in which cameras accept them: automatics first."""
    found: list[Wish] = []
    if config.exposure_s is not None:
        found += [
            Wish(Control.EXPOSURE_AUTO, EXPOSURE_MANUAL, needed=False),
            Wish(
                Control.EXPOSURE_ABSOLUTE,
                max(round(config.exposure_s * 1e9 / EXPOSURE_UNIT_NS), 1),
                needed=True,
            ),
        ]
    if config.gain is not None:
        found += [
            Wish(Control.AUTOGAIN, 0, needed=False),
            Wish(Control.GAIN, config.gain, needed=True),
        ]
    if config.focus is not None:
        found += [
            Wish(Control.FOCUS_AUTO, 0, needed=False),
            Wish(Control.FOCUS_ABSOLUTE, config.focus, needed=True),
        ]
    if config.power_line_hz is not None:
        value = POWER_LINE[config.power_line_hz]
        found.append(Wish(Control.POWER_LINE_FREQUENCY, value, needed=True))
    return tuple(found)


def apply_mode(source: VideoSource, config: V4l2Config, facts: DeviceFacts) -> float | None:
    """Set format, size and rate; the rate in force (None: not told).

    Raises `DeviceFaultError` that names what was asked and what the camera does instead.
    """
    modes = source.modes()
    formats = sorted({mode.fourcc for mode in modes})
    if config.fourcc not in formats:
        raise DeviceFaultError(
            f"{config.path}: {facts.card} offers no {config.fourcc}, only "
            f"{', '.join(formats) or 'nothing'}; {_other_format(formats)}"
        )
    in_force = source.set_mode(config.fourcc, config.width_px, config.height_px)
    if in_force != (config.fourcc, config.width_px, config.height_px):
        fourcc, width, height = in_force
        raise DeviceFaultError(
            f"{config.path}: asked {facts.card} for {config.width_px} x {config.height_px} "
            f"{config.fourcc}, got {width} x {height} {fourcc}; "
            f"it offers {_sizes(modes, config.fourcc)}{bus_hint(config, facts)}"
        )
    rate = source.set_rate(config.rate_hz)
    # A camera tells 29.97 for 30 as a fraction, and that is what it is; 15 or 60 is not.
    if rate is not None and abs(rate - config.rate_hz) > 0.01 * config.rate_hz:
        raise DeviceFaultError(
            f"{config.path}: asked {facts.card} for {mode_text(config)}, got {rate:g} Hz; "
            f"at this size it offers {_rates(modes, config)}{bus_hint(config, facts)}"
        )
    return rate


def apply_controls(source: VideoSource, config: V4l2Config, facts: DeviceFacts) -> None:
    """Set the controls and compare what the camera says of them afterwards.

    Raises `DeviceFaultError` that names the control, what was asked, and what is in force.
    """
    if config.exposure_s is None:
        _exposure_automatic(source, f"{config.path}: {facts.card}")
    for wish in wishes(config):
        _apply(source, wish, f"{config.path}: {facts.card}")


def controls_in_force(source: VideoSource) -> dict[str, int]:
    """Every control that the camera has and lets us read, by its name in small letters."""
    found = {}
    for control in Control:
        try:
            if source.control_range(control) is not None:
                found[control.name.lower()] = source.get_control(control)
        except OSError:
            continue  # listed but not readable: some cameras do that with what is switched off
    return found


def _exposure_automatic(source: VideoSource, who: str) -> None:
    """Automatic exposure that holds the frame rate; a camera without these has nothing to set."""
    if source.control_range(Control.EXPOSURE_AUTO) is not None:
        try:
            source.set_control(Control.EXPOSURE_AUTO, EXPOSURE_APERTURE_PRIORITY)
        except OSError:  # UVC cameras know aperture priority, most others automatic
            source.set_control(Control.EXPOSURE_AUTO, EXPOSURE_AUTOMATIC)
        if source.get_control(Control.EXPOSURE_AUTO) == EXPOSURE_MANUAL:
            raise DeviceFaultError(
                f"{who}: asked for automatic exposure, got the manual one; set exposure_s"
            )
    if source.control_range(Control.EXPOSURE_AUTO_PRIORITY) is not None:
        # Where this fails the rate may sink in the dark, and the measured rate tells that.
        with contextlib.suppress(OSError):
            source.set_control(Control.EXPOSURE_AUTO_PRIORITY, 0)


def _apply(source: VideoSource, wish: Wish, who: str) -> None:
    name = wish.control.name.lower()
    limits = source.control_range(wish.control)
    if limits is None:
        if not wish.needed:
            return
        raise DeviceFaultError(f"{who} has no control {name}; leave that setting out")
    if not limits.minimum <= wish.value <= limits.maximum:
        raise DeviceFaultError(
            f"{who}: {name} {wish.value} is out of range; it goes from {limits.minimum} to "
            f"{limits.maximum} in steps of {limits.step}{_in_seconds(wish.control)}"
        )
    source.set_control(wish.control, wish.value)
    got = source.get_control(wish.control)
    if got != wish.value:
        raise DeviceFaultError(
            f"{who}: asked for {name} {wish.value}, got {got} (steps of {limits.step}"
            f"{_in_seconds(wish.control)}); ask for a value that the camera can keep"
        )


def _in_seconds(control: Control) -> str:
    return "; one is 0.0001 s" if control is Control.EXPOSURE_ABSOLUTE else ""


def _other_format(formats: list[str]) -> str:
    usable = [fourcc for fourcc in formats if fourcc in FRAME_FORMATS]
    if not usable:
        return f"another camera is needed: we read {', '.join(FRAME_FORMATS)}"
    return f"ask for {' or '.join(usable)}, uncompressed at a small size or a low rate"


def _sizes(modes: tuple[VideoMode, ...], fourcc: str) -> str:
    sizes = {(mode.width_px, mode.height_px) for mode in modes if mode.fourcc == fourcc}
    return ", ".join(f"{width} x {height}" for width, height in sorted(sizes))


def _rates(modes: tuple[VideoMode, ...], config: V4l2Config) -> str:
    wanted = (config.fourcc, config.width_px, config.height_px)
    rates = {
        rate
        for mode in modes
        if (mode.fourcc, mode.width_px, mode.height_px) == wanted
        for rate in mode.rates_hz
    }
    return ", ".join(f"{rate:g} Hz" for rate in sorted(rates)) or "no other rate that it tells"
