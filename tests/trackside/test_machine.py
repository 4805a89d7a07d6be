from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from trackside import machine as checks
from trackside.finding import Finding
from trackside.machine import Machine

MAY_2026_S = 1_778_000_000.0


class Root:
    """A made-up machine."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def put(self, name: str, text: str) -> None:
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def lidar_adapter(self, control: str = "on") -> None:
        self.put("sys/bus/usb/devices/1-2/idVendor", "10c4\n")
        self.put("sys/bus/usb/devices/1-2/idProduct", "ea60\n")
        self.put("sys/bus/usb/devices/1-2/power/control", f"{control}\n")

    def look(self, check: Callable[[Machine], Finding]) -> Finding:
        return check(Machine(self.folder, lambda: MAY_2026_S))


@pytest.fixture
def root(tmp_path: Path) -> Root:
    return Root(tmp_path)


@pytest.mark.parametrize(
    "check",
    [
        checks.modem_manager,
        checks.brltty,
        checks.udev_rules,
        checks.kernel_modules,
        checks.usb_power,
        checks.power,
        checks.clock,
    ],
)
def test_a_machine_without_anything_special_is_well(
    root: Root, check: Callable[[Machine], Finding]
) -> None:
    assert root.look(check).well


def test_a_running_modem_manager_is_a_fault(root: Root) -> None:
    root.put("proc/1/comm", "systemd\n")
    root.put("proc/812/comm", "ModemManager\n")
    found = root.look(checks.modem_manager)
    assert not found.well
    assert "mask --now ModemManager" in found.remedy


def test_brltty_is_a_fault_when_it_claims_our_adapter(root: Root) -> None:
    root.put("usr/lib/udev/rules.d/85-brltty.rules", 'ATTRS{idVendor}=="1a86"')
    assert root.look(checks.brltty).well
    root.put("usr/lib/udev/rules.d/85-brltty.rules", 'ENV{PRODUCT}=="10C4/ea60/*"')
    assert not root.look(checks.brltty).well


def test_rules_are_missed_only_where_a_device_needs_them(root: Root) -> None:
    root.put("etc/udev/rules.d/10-other.rules", "nothing of ours")
    assert root.look(checks.udev_rules).well
    root.lidar_adapter()
    found = root.look(checks.udev_rules)
    assert not found.well
    assert "trackside devices --udev-rules" in found.remedy
    root.put("etc/udev/rules.d/99-rc-car.rules", 'SYMLINK+="rc/lidar"')
    assert root.look(checks.udev_rules).well


def test_a_kernel_without_serial_drivers_is_a_fault(root: Root) -> None:
    root.put("lib/modules/4.9/modules.dep", "kernel/drivers/usb/class/cdc-acm.ko:\n")
    found = root.look(checks.kernel_modules)
    assert found.seen == "the kernel has no cp210x"
    root.put("lib/modules/4.9/modules.builtin", "kernel/drivers/usb/serial/cp210x.ko\n")
    assert root.look(checks.kernel_modules).well


def test_a_device_that_may_sleep_is_a_fault(root: Root) -> None:
    root.lidar_adapter("on")
    assert root.look(checks.usb_power).well
    root.lidar_adapter("auto")
    assert "CP210x" in root.look(checks.usb_power).seen


def test_an_empty_battery_and_a_voltage_alarm_are_faults(root: Root) -> None:
    root.put("sys/class/power_supply/BAT0/capacity", "12\n")
    root.put("sys/class/power_supply/BAT0/status", "Charging\n")
    assert root.look(checks.power).well
    root.put("sys/class/power_supply/BAT0/status", "Discharging\n")
    root.put("sys/class/hwmon/hwmon3/in1_lcrit_alarm", "1\n")
    found = root.look(checks.power)
    assert "BAT0 at 12 %" in found.seen
    assert "hwmon3/in1_lcrit_alarm" in found.seen


def test_a_clock_that_starts_in_1970_is_a_fault(root: Root) -> None:
    found = checks.clock(Machine(root.folder, lambda: 86_400.0))
    assert not found.well
    assert "1970-01-02" in found.seen


def test_a_clock_that_the_network_keeps_is_told(root: Root) -> None:
    assert "not synchronised" in root.look(checks.clock).seen
    root.put("run/systemd/timesync/synchronized", "")
    assert "kept by the network" in root.look(checks.clock).seen


def ticking(step_s: float) -> Callable[[], float]:
    ticks: Iterator[int] = count()
    return lambda: next(ticks) * step_s


@pytest.mark.parametrize(
    ("step_s", "cameras", "well"),
    [(0.001, False, True), (0.001, True, True), (0.05, True, False), (3.0, False, False)],
)
def test_a_disk_is_judged_by_what_the_rig_needs(
    tmp_path: Path, step_s: float, cameras: bool, well: bool
) -> None:
    machine = Machine(tmp_path, clock_s=ticking(step_s))
    found = checks.disk_speed(machine, tmp_path, cameras)
    assert found.well is well, found.seen
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_a_fault(tmp_path: Path) -> None:
    found = checks.disk_speed(Machine(), tmp_path / "nowhere", cameras=False)
    assert not found.well
    assert "No such file" in found.seen
