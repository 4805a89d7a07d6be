from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from capture import (
    ConfigurationError,
    configuration_from_mapping,
    configuration_from_text,
    read_configuration,
    with_overrides,
)
from dialogue import UsageError


@dataclass(frozen=True, kw_only=True)
class Lidar:
    port: str = "/dev/ttyUSB0"
    rate_hz: float = field(default=10.0, metadata={"min": 5.0, "max": 15.0})
    angles_deg: tuple[float, ...] = field(default=(), metadata={"min": -180.0})


@dataclass(frozen=True, kw_only=True)
class Rig:
    name: str
    lidar: Lidar = field(default_factory=Lidar)
    wheels: int = field(default=4, metadata={"min": 1})
    armed: bool = False
    gate: float = math.inf
    seed: int | None = None
    mode: Literal["fast", "slow"] = "fast"
    colour: str = field(default="red", metadata={"choices": ("red", "green")})
    notes: Mapping[str, object] = field(default_factory=dict)
    spares: tuple[Lidar, ...] = ()

    def __post_init__(self) -> None:
        if self.wheels == 3:
            raise ValueError("three wheels make no car")


def faults(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_text(Rig, text, "rig.yaml")
    return str(caught.value).splitlines()


def test_every_kind_of_value(tmp_path: Path) -> None:
    file = tmp_path / "rig.yaml"
    file.write_text(
        "name: 'no'\nlidar: {rate_hz: 7, angles_deg: [1, -2e1]}\nwheels: 6\narmed: true\n"
        "gate: 1e-3\nseed: 5\nmode: slow\ncolour: green\nnotes: {a: [1, x]}\n"
        "spares: [{port: b}]\n"
    )
    assert read_configuration(Rig, file) == Rig(
        name="no",
        lidar=Lidar(rate_hz=7.0, angles_deg=(1.0, -20.0)),
        wheels=6,
        armed=True,
        gate=0.001,
        seed=5,
        mode="slow",
        colour="green",
        notes={"a": [1, "x"]},
        spares=(Lidar(port="b"),),
    )


def test_defaults_stand_where_nothing_is_said() -> None:
    assert configuration_from_text(Rig, "name: a\nseed: null\ngate: .inf\n", "x") == Rig(name="a")


def test_all_faults_come_at_once_in_order_of_their_place() -> None:
    text = (
        "lidar:\n  prot: x\n  rate_hz: 20\nwheels: 0\narmed: 1\nwheels: 5\n"
        "mode: medium\ncolour: blue\nseed: x\nspares: [{rate_hz: no}, 3]\nnotes: 4\n"
    )
    assert faults(text) == [
        "rig.yaml:1:1: name: missing; it has no default",
        "rig.yaml:2:3: lidar.prot: unknown key; did you mean 'port'?",
        "rig.yaml:3:12: lidar.rate_hz: 20.0 is too large; expected at most 15.0",
        "rig.yaml:4:9: wheels: 0 is too small; expected at least 1",
        "rig.yaml:5:8: armed: expected true or false, found the number '1'",
        "rig.yaml:6:1: wheels: stands in line 4 already; keep one of them",
        "rig.yaml:7:7: mode: 'medium' is no choice; valid names: fast, slow",
        "rig.yaml:8:9: colour: 'blue' is no choice; valid names: green, red",
        "rig.yaml:9:7: seed: expected an integer, found the text 'x'",
        "rig.yaml:10:20: spares[0].rate_hz: expected a number, found the truth value 'no'",
        "rig.yaml:10:25: spares[1]: expected keys with values, found the number '3'",
        "rig.yaml:11:8: notes: expected keys with values, found the number '4'",
    ]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("name: no", "name: expected text, found the truth value 'no'; put it in quotes"),
        ("name: 1.0", "name: expected text, found the number '1.0'; put it in quotes"),
        ("name:", "name: expected text, found nothing; put it in quotes"),
        ("name: [a]", "name: expected text, found a list"),
        ("{name: a, wheels: 2.5}", "wheels: expected an integer, found the number '2.5'"),
        ("{name: a, wheels: 1:30}", "wheels: expected an integer, found the number '1:30'"),
        ("{name: a, gate: '3'}", "gate: expected a number, found the text '3'"),
        ("{name: a, gate: .nan}", "gate: expected a number, found the number '.nan'"),
        ("{name: a, gate: 1_0}", "gate: expected a number, found the number '1_0'"),
        ("{name: a, wheels: 3}", "three wheels make no car"),
        ("{name: a, lidar: {angles_deg: 3}}", "angles_deg: expected a list, found the number"),
        ("{name: a, lidar: {angles_deg: [-200]}}", "-200.0 is too small"),
        ("[1]", "expected keys with values, found a list"),
        ("{name: a", "no valid YAML"),
    ],
)
def test_traps_of_yaml_are_faults(line: str, message: str) -> None:
    (fault,) = faults(line + "\n")
    assert fault.startswith("rig.yaml:")
    assert message in fault


def test_a_missing_file() -> None:
    with pytest.raises(ConfigurationError, match="no such file"):
        read_configuration(Rig, Path("absent.yaml"))


def test_a_stored_configuration_comes_back() -> None:
    rig = Rig(name="1e3", gate=math.inf, spares=(Lidar(rate_hz=5.5),), notes={"x": None})
    assert configuration_from_mapping(Rig, dataclasses.asdict(rig), "estimate.yaml") == rig
    with pytest.raises(ConfigurationError, match=r"^estimate.yaml: wheel: unknown key"):
        configuration_from_mapping(Rig, {"name": "a", "wheel": 1}, "estimate.yaml")


def test_overrides_reach_into_parts_and_leave_the_rest() -> None:
    rig = Rig(name="a", wheels=6)
    changed = with_overrides(rig, ["lidar.rate_hz=1.1e1", "name=true colours", "seed=4", "seed="])
    assert changed == Rig(name="true colours", wheels=6, lidar=Lidar(rate_hz=11.0))
    assert with_overrides(rig, []) == rig


def test_all_wrong_overrides_are_told() -> None:
    with pytest.raises(UsageError) as caught:
        with_overrides(
            Rig(name="a"),
            ["lidar.rat_hz=3", "wheels=x", "gate", "lidar.rate_hz=99", "gate.x=1", "wheels=3"],
        )
    assert str(caught.value).splitlines() == [
        "lidar.rat_hz: no such key; did you mean 'rate_hz'?",
        "wheels=x: expected an integer, found the text 'x'",
        "'gate' is no assignment; expected key=value",
        "lidar.rate_hz=99: 99.0 is too large; expected at most 15.0",
        "gate.x: has no parts to set; leave out '.x'",
        "wheels=3: three wheels make no car",
    ]
