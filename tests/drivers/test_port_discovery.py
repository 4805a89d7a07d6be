from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from drivers import DeviceModel, ModelPort, PortBusyError, PtyEmulator
from drivers.discovery import PortFound, ask, ask_all, stable_path
from drivers.imu.razor import razor_model
from drivers.port import Port
from drivers.rplidar import LidarPort, RPLidarModel, emulated_lidar
from drivers.udev import RULES
from drivers.vesc import VescModel, emulated_vesc


def behind(model: DeviceModel) -> Callable[[str, int], Port]:
    """Opens a new port to the same device each time, in one simulated time."""
    ports: list[ModelPort] = []

    def open_port(_: str, baud: int) -> Port:
        start_ns = ports[-1].now_ns() if ports else 0
        if isinstance(model, RPLidarModel):
            ports.append(LidarPort(model, baud=baud, start_ns=start_ns))
        else:
            ports.append(ModelPort(model, start_ns=start_ns))
        return ports[-1]

    return open_port


@pytest.mark.parametrize("usb_id", ["", "10c4:ea60", "0483:5740", "1b4f:9d0f"])
@pytest.mark.parametrize(
    ("model", "kind"),
    [(emulated_lidar, "lidar"), (emulated_vesc, "vesc"), (razor_model, "razor")],
)
def test_whoever_is_there_is_found_whatever_the_adapter_suggests(
    model: Callable[[], DeviceModel], kind: str, usb_id: str
) -> None:
    found = ask(PortFound("/dev/x", "/dev/x", usb_id=usb_id), behind(model()))
    assert found.kind == kind, found.problem
    assert found.identity["model"]


def test_asking_moves_nothing_and_sets_nothing() -> None:
    lidar, vesc = emulated_lidar(), emulated_vesc()
    for model in (lidar, vesc):
        ask(PortFound("/dev/x", "/dev/x"), behind(model))
    assert lidar.rotor.target_hz == 0.0
    assert isinstance(vesc, VescModel)
    assert vesc.obeyed == []
    assert vesc.dangers == []


class Mute:
    def receive(self, data: bytes, now_ns: int) -> None:
        """Nothing."""

    def transmit(self, now_ns: int) -> bytes:  # noqa: ARG002  the model's signature
        return b""

    def next_ns(self) -> int | None:
        return None


def test_a_silent_port_says_what_was_tried() -> None:
    found = ask(PortFound("/dev/x", "/dev/x"), behind(Mute()))
    assert found.kind is None
    assert found.problem is not None
    assert "silent" in found.problem


def test_a_port_that_cannot_be_opened_says_why() -> None:
    def busy(path: str, _: int) -> Port:
        raise PortBusyError(f"{path}: another program holds it")

    found = ask(PortFound("/dev/x", "/dev/x"), busy)
    assert found.problem == "/dev/x: another program holds it"


def test_all_ports_are_asked_and_keep_their_order() -> None:
    with PtyEmulator(emulated_vesc()) as one, PtyEmulator(emulated_vesc("3.40")) as other:
        ports = [PortFound(path, path) for path in (other.path, one.path)]
        found = ask_all(ports)
    assert [port.identity["firmware"] for port in found] == ["3.40", "5.02"]
    assert ask_all([]) == ()


def test_the_best_name_of_a_port_is_the_first_link_that_leads_to_it(tmp_path: Path) -> None:
    node = tmp_path / "ttyUSB0"
    node.touch()
    for folder in ("rc", "by-id"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "name").symlink_to(node)
    folders = [str(tmp_path / "none"), str(tmp_path / "rc"), str(tmp_path / "by-id")]
    assert stable_path(str(node), folders) == str(tmp_path / "rc" / "name")
    assert stable_path(str(node), folders[:1]) == str(node)


def test_the_udev_rules_are_one_rule_a_line() -> None:
    rules = [line for line in RULES.splitlines() if line and not line.startswith("#")]
    assert len(rules) >= 9
    for rule in rules:
        assert "==" in rule.split(",")[0]
        assert "\\" not in rule
    for name in ("lidar", "vesc", "imu", "zed"):
        assert f'SYMLINK+="rc/{name}"' in RULES
