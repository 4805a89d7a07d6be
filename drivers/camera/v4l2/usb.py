"""What sysfs knows of the USB device behind a video node: ids, serial number, speed of its port.

Source: kernel, Documentation/ABI/stable/sysfs-bus-usb.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SYSFS = Path("/sys")


@dataclass(frozen=True)
class UsbFacts:
    """usb_id : `2b03:f582`; each is None where sysfs does not say, as for a camera not on USB."""

    usb_id: str | None = None
    serial: str | None = None
    mbit_s: float | None = None


def usb_facts(node: str, sysfs: Path = SYSFS) -> UsbFacts:
    """Facts of the device whose interface carries a node such as `video0`; never raises."""
    interface = sysfs / "class" / "video4linux" / node / "device"
    try:
        device = interface.resolve().parent  # the node's device is the interface, above it the USB
    except (OSError, RuntimeError):
        return UsbFacts()
    vendor, product = _text(device / "idVendor"), _text(device / "idProduct")
    if vendor is None or product is None:
        return UsbFacts()
    speed = _text(device / "speed")
    try:
        mbit_s = None if speed is None else float(speed)
    except ValueError:
        mbit_s = None
    return UsbFacts(f"{vendor}:{product}", _text(device / "serial"), mbit_s)


def card_name(node: str, sysfs: Path = SYSFS) -> str | None:
    """The name that the driver gave a node, readable without opening it; None if there is none."""
    return _text(sysfs / "class" / "video4linux" / node / "name")


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip() or None
    except OSError:
        return None
