"""What on this machine would spoil a recording: services, permissions, power, disk, clock.

Every check looks at files only, below `Machine.root`, so that a test can make up a machine.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from trackside.finding import Finding

KNOWN_USB = {
    ("10c4", "ea60"): "CP210x (RPLidar)",
    ("0483", "5740"): "STM32 (VESC)",
    ("1b4f", "9d0f"): "Razor IMU",
    ("0403", "6001"): "FTDI adapter",
    ("0403", "6015"): "FTDI adapter",
}
"""Vendor and product of what stands in `docs/car.md`."""

SYNC_FILES = ("run/systemd/timesync/synchronized", "run/chrony/chronyd.pid", "run/chronyd.pid")
PROBE_BYTES = 32_000_000
MIN_DISK_MB_S = 4.0
CAMERA_DISK_MB_S = 40.0
MAX_STALL_S = 2.0
MIN_BATTERY_PERCENT = 20
FIRST_PLAUSIBLE_UTC_S = 1_735_689_600
"""2025-01-01: a Jetson without a clock battery starts before that."""


@dataclass(frozen=True)
class Machine:
    """The machine as its files under `root` show it."""

    root: Path = Path("/")
    utc_s: Callable[[], float] = time.time
    clock_s: Callable[[], float] = time.monotonic

    def text(self, name: str | Path) -> str:
        """What a file below the root holds, stripped; empty where it cannot be read."""
        try:
            return (self.root / name).read_text(errors="replace").strip()
        except OSError:
            return ""

    def found(self, pattern: str) -> list[Path]:
        """The files that match, sorted."""
        return sorted(self.root.glob(pattern))

    def programs(self) -> set[str]:
        """Names of all running programs."""
        return {self.text(p) for p in self.found("proc/[0-9]*/comm")}

    def usb_devices(self) -> Iterator[tuple[Path, str]]:
        """Folders of the USB devices we know, and what they are."""
        for vendor in self.found("sys/bus/usb/devices/*/idVendor"):
            folder = vendor.parent
            product = self.text(folder / "idProduct")
            known = KNOWN_USB.get((vendor.read_text().strip(), product))
            if known:
                yield folder, known


def modem_manager(machine: Machine) -> Finding:
    """ModemManager writes AT commands to every new serial port, for up to half a minute."""
    running = "ModemManager" in machine.programs()
    return Finding(
        "ModemManager",
        not running,
        "running: it talks to our serial ports" if running else "not running",
        "sudo systemctl mask --now ModemManager" if running else "",
    )


def brltty(machine: Machine) -> Finding:
    """Brltty takes some USB serial adapters for braille displays (Ubuntu 22.04)."""
    rules = [
        path
        for folder in ("usr/lib/udev/rules.d", "lib/udev/rules.d", "etc/udev/rules.d")
        for path in machine.found(f"{folder}/*brltty*")
    ]
    claims = [p for p in rules if "10c4" in p.read_text(errors="replace").lower()]
    bad = "brltty" in machine.programs() or bool(claims)
    seen = "installed: it claims USB serial adapters" if bad else "does not claim our adapters"
    return Finding("brltty", not bad, seen, "sudo apt remove brltty" if bad else "")


def udev_rules(machine: Machine) -> Finding:
    """Our rules give ports stable names and the right group."""
    written = [
        path
        for path in machine.found("etc/udev/rules.d/*.rules")
        if 'SYMLINK+="rc/' in path.read_text(errors="replace")
    ]
    needed = any(True for _ in machine.usb_devices())
    remedy = "trackside devices --udev-rules | sudo tee /etc/udev/rules.d/99-rc-car.rules"
    seen = f"in {written[0].name}" if written else "none of ours"
    return Finding("udev rules", bool(written) or not needed, seen, "" if written else remedy)


def kernel_modules(machine: Machine) -> Finding:
    """Early Jetson kernels came without the drivers of USB serial adapters."""
    missing = []
    for index in machine.found("lib/modules/*/modules.dep"):
        if index.parent.name != os.uname().release and machine.root == Path("/"):
            continue
        known = index.read_text(errors="replace") + machine.text(index.parent / "modules.builtin")
        missing = [name for name in ("cp210x", "cdc-acm") if f"/{name}.ko" not in known]
    seen = f"the kernel has no {' and no '.join(missing)}" if missing else "serial drivers present"
    remedy = "install the modules of this kernel (docs/car.md)" if missing else ""
    return Finding("kernel modules", not missing, seen, remedy)


def usb_power(machine: Machine) -> Finding:
    """A USB device that is put to sleep loses bytes."""
    asleep = [
        known
        for folder, known in machine.usb_devices()
        if machine.text(folder / "power/control") == "auto"
    ]
    seen = (
        f"may be put to sleep: {', '.join(asleep)}" if asleep else "no device may be put to sleep"
    )
    remedy = "install the udev rules, or boot with usbcore.autosuspend=-1" if asleep else ""
    return Finding("USB power", not asleep, seen, remedy)


def power(machine: Machine) -> Finding:
    """Batteries that are nearly empty, and supplies whose own alarm is on."""
    faults = []
    for battery in machine.found("sys/class/power_supply/*/capacity"):
        name = battery.parent.name
        percent = battery.read_text(errors="replace").strip()
        state = machine.text(battery.parent / "status")
        if percent.isdecimal() and int(percent) < MIN_BATTERY_PERCENT and state == "Discharging":
            faults.append(f"{name} at {percent} %")
    for alarm in machine.found("sys/class/hwmon/*/in*_*alarm"):
        if alarm.read_text(errors="replace").strip() == "1":
            faults.append(f"{alarm.parent.name}/{alarm.name}: voltage out of range")
    remedy = "charge or change the battery" if faults else ""
    return Finding("power", not faults, ", ".join(faults) or "no alarm", remedy)


def clock(machine: Machine) -> Finding:
    """A clock far in the past makes folders of 1970; one that is not set is only remarked."""
    utc_s = machine.utc_s()
    told = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(utc_s))
    well = utc_s >= FIRST_PLAUSIBLE_UTC_S
    synchronised = any(machine.found(name) for name in SYNC_FILES)
    state = "kept by the network" if synchronised else "not synchronised; join will measure it"
    remedy = "" if well else "set it: sudo date -s '2026-05-14 10:00', or chrony (docs/car.md)"
    return Finding("clock", well, f"{told}, {state}", remedy)


def disk_speed(machine: Machine, folder: Path, cameras: bool) -> Finding:
    """Write as the recorder does, a chunk and a sync at a time, and time it."""
    needed_mb_s = CAMERA_DISK_MB_S if cameras else MIN_DISK_MB_S
    file = folder / f".trackside-disk-probe-{os.getpid()}"
    chunk = os.urandom(1_000_000)
    stall_s, started_s = 0.0, machine.clock_s()
    try:
        with file.open("wb", buffering=0) as stream:
            for _ in range(PROBE_BYTES // len(chunk)):
                before_s = machine.clock_s()
                stream.write(chunk)
                os.fdatasync(stream.fileno())
                stall_s = max(stall_s, machine.clock_s() - before_s)
    except OSError as err:
        return Finding("disk speed", False, f"{folder}: {err.strerror or err}", "record elsewhere")
    finally:
        file.unlink(missing_ok=True)
    rate_mb_s = PROBE_BYTES * 1e-6 / max(machine.clock_s() - started_s, 1e-9)
    well = rate_mb_s >= needed_mb_s and stall_s < MAX_STALL_S
    seen = f"{rate_mb_s:.0f} MB/s of {needed_mb_s:g} needed, longest stall {stall_s * 1e3:.0f} ms"
    return Finding("disk speed", well, seen, "" if well else "record onto a faster disk or card")
