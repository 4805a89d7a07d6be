"""`trackside emulate`, as other programs meet it."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drivers import SerialPort
from drivers.discovery import PortFound, ask
from drivers.imu.razor import RazorModel
from drivers.rplidar import Revolution, RPLidar, RPLidarConfig

COMMAND = [sys.executable, "-m", "trackside", "emulate"]


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *words], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("device", "kind"), [("rplidar", "lidar"), ("vesc", "vesc")])
def test_an_emulated_device_answers_under_its_link_until_it_is_stopped(
    tmp_path: Path, device: str, kind: str
) -> None:
    link = tmp_path / "port"
    with subprocess.Popen(
        [*COMMAND, device, "--link", str(link)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == str(link)
        found = ask(PortFound(str(link), str(link)))
        process.send_signal(signal.SIGTERM)
        rest = process.stdout.read()
    assert found.kind == kind, found.problem
    assert rest.startswith("sent ")
    assert process.returncode == 0
    assert not link.is_symlink()


@pytest.mark.realdata
def test_a_real_capture_is_scanned_again(data_dir: Path) -> None:
    capture = data_dir / "rplidar" / "standard_scan" / "sample_data_pyserial_1.txt"
    with subprocess.Popen(
        [*COMMAND, "rplidar", "--replay", str(capture)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        lidar = RPLidar(RPLidarConfig(process.stdout.readline().strip()))
        lidar.connect()
        turns: list[Revolution] = []
        while len(turns) < 3:
            reading = lidar.read(5.0)
            assert reading is not None
            turns += reading.samples
        lidar.close()
        process.terminate()
    assert all(200 < len(turn) < 400 for turn in turns)


def test_recorded_lines_of_a_razor_are_sent_as_they_are(tmp_path: Path) -> None:
    model = RazorModel()
    lines = b"".join(model.transmit(k * 10_000_000) for k in range(300)).splitlines(keepends=True)
    file = tmp_path / "razor.txt"
    file.write_bytes(b"".join(lines[5:60]))
    with subprocess.Popen(
        [*COMMAND, "razor", "--replay", str(file)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        port = SerialPort(process.stdout.readline().strip())
        heard = b""
        while heard.count(b"\n") < 20:
            chunk = port.read(5.0)
            assert chunk is not None
            heard += chunk.data
        port.close()
        process.terminate()
    whole = heard.splitlines(keepends=True)[1:10]
    assert b"".join(whole) in file.read_bytes() * 2


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("rplidar", "--mode", "Bost"), "did you mean 'Boost'?"),
        (("vesc", "--firmware", "new"), "is no version"),
        (("rplidar", "--replay", "nowhere.bin"), "nowhere.bin"),
        (("razor", "--replay", "nowhere.txt"), "cannot be read"),
    ],
)
def test_what_cannot_be_emulated_is_told(words: tuple[str, ...], why: str) -> None:
    done = run(*words)
    assert done.returncode == 2
    assert why in done.stderr


def test_a_link_that_exists_is_not_replaced(tmp_path: Path) -> None:
    taken = tmp_path / "port"
    taken.write_text("mine")
    done = run("razor", "--link", str(taken), "--seconds", "1")
    assert done.returncode == 2
    assert taken.read_text() == "mine"
