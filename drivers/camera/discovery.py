"""Which cameras this machine has, by the paths that stay the same."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from drivers.camera.v4l2.driver import open_linux
from drivers.camera.v4l2.faults import opening_error
from drivers.camera.v4l2.source import DeviceFacts, VideoMode, VideoSource
from drivers.camera.v4l2.usb import SYSFS, card_name
from drivers.errors import DriverError

DEVICES = Path("/dev")
STABLE = ("v4l/by-id", "v4l/by-path")
"""Folders of links in which a camera keeps its name, the better one first."""


@dataclass(frozen=True)
class CameraFound:
    """A camera of this machine.

    path : the best name for it in a configuration; node : /dev/videoN, today; card, driver, bus,
    usb_id, serial, usb_mbit_s : as `DeviceFacts`, None where not known; modes : what it offers;
    problem : why it could not be asked, None if it was.
    """

    path: str
    node: str
    card: str | None = None
    driver: str | None = None
    bus: str | None = None
    usb_id: str | None = None
    serial: str | None = None
    usb_mbit_s: float | None = None
    modes: tuple[VideoMode, ...] = ()
    problem: str | None = None


def list_cameras(
    open_source: Callable[[str], VideoSource] = open_linux,
    *,
    devices: Path = DEVICES,
    sysfs: Path = SYSFS,
) -> tuple[CameraFound, ...]:
    """Every camera, by its node's number; one that cannot be asked is listed with the reason.

    Nodes that give no video (metadata) are left out. Never raises.
    """
    found = []
    for node in sorted(devices.glob("video*"), key=_number):
        camera = _ask(_stable_path(node, devices), node, open_source, sysfs)
        if camera is not None:
            found.append(camera)
    return tuple(found)


def _ask(
    path: str, node: Path, open_source: Callable[[str], VideoSource], sysfs: Path
) -> CameraFound | None:
    """What a node says of itself; None if it is no camera."""
    try:
        source = open_source(path)
        try:
            facts = source.facts()
            modes = source.modes() if facts.captures else ()
        finally:
            source.close()
    except DriverError as err:
        problem = str(err)
    except OSError as err:
        problem = str(opening_error(path, err))
    except Exception as err:  # a list of all cameras must not end at an odd one
        problem = f"{path}: gave an answer that was not understood ({err!r}); see dmesg"
    else:
        return _described(path, node, facts, modes) if facts.captures else None
    return CameraFound(path, str(node), card=card_name(node.name, sysfs), problem=problem)


def _described(
    path: str, node: Path, facts: DeviceFacts, modes: tuple[VideoMode, ...]
) -> CameraFound:
    return CameraFound(
        path,
        str(node),
        facts.card,
        facts.driver,
        facts.bus,
        facts.usb_id,
        facts.serial,
        facts.usb_mbit_s,
        modes,
    )


def _stable_path(node: Path, devices: Path) -> str:
    """The link that leads to a node, by-id before by-path; the node itself if there is none."""
    for folder in STABLE:
        # No such folder, or links in a circle: then another name has to do.
        with contextlib.suppress(OSError, RuntimeError):
            for link in sorted((devices / folder).iterdir()):
                if link.resolve() == node.resolve():
                    return str(link)
    return str(node)


def _number(node: Path) -> tuple[int, str]:
    digits = node.name.removeprefix("video")
    return (int(digits), "") if digits.isdecimal() else (1 << 31, digits)
