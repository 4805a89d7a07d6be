from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from drivers import PtyEmulator
from drivers.vesc import emulated_vesc
from trackside.doctor import doctor
from trackside.finding import Finding
from trackside.rig_checks import rig_findings


def findings(folder: Path, text: str) -> dict[str, Finding]:
    file = folder / "rig.yaml"
    file.write_text(text)
    return {f.what: f for f in rig_findings(file)[0]}


def test_a_port_that_can_be_opened_is_well(tmp_path: Path) -> None:
    with PtyEmulator(emulated_vesc()) as emulator:
        found = findings(tmp_path, f"vesc:\n  port: {emulator.path}\n")
    assert found["rig"].well
    assert found["vesc"].well


def test_everything_that_is_missing_is_told_at_once(tmp_path: Path) -> None:
    found = findings(
        tmp_path,
        "lidar:\n  port: /dev/nowhere1\nrazor:\n  port: /dev/nowhere2\n"
        "overhead:\n  path: /dev/nowhere3\n",
    )
    for name, path in {"lidar": "1", "razor": "2", "overhead": "3"}.items():
        assert not found[name].well
        assert f"/dev/nowhere{path}" in found[name].seen
        assert found[name].remedy


def test_an_i2c_bus_that_is_missing_is_told(tmp_path: Path) -> None:
    found = findings(tmp_path, "mpu9250:\n  bus: /dev/i2c-99\n")
    assert not found["mpu9250"].well
    assert "/dev/i2c-99" in found["mpu9250"].seen


def test_a_rig_with_a_mistyped_key_is_told_with_its_place(tmp_path: Path) -> None:
    found = findings(tmp_path, "lidar:\n  prt: /dev/x\n")
    assert not found["rig"].well
    assert "rig.yaml:2:3: lidar.prt: unknown key; did you mean 'port'?" in found["rig"].seen


def test_doctor_looks_at_a_rig_that_lies_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "only the installation" in CliRunner().invoke(doctor).output
    (tmp_path / "rig.yaml").write_text("lidar:\n  port: /dev/nowhere\n")
    result = CliRunner().invoke(doctor)
    assert result.exit_code == 1
    assert "/dev/nowhere" in result.output
    assert "disk speed" in result.output
