from __future__ import annotations

import dataclasses
import errno
from pathlib import Path

import pytest
from camera_pictures import jpeg

from drivers.camera import CameraEmulator, list_cameras
from drivers.camera.v4l2 import VideoSource
from drivers.camera.v4l2.emulator import FACTS, MODES
from drivers.camera.v4l2.usb import UsbFacts, card_name, usb_facts


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    """A camera at 480 Mbit/s behind video0 and video1, as the kernel shows it."""
    device = tmp_path / "sys" / "devices" / "usb1" / "1-2"
    interface = device / "1-2:1.0"
    interface.mkdir(parents=True)
    for name, text in {
        "idVendor": "2b03",
        "idProduct": "f582",
        "serial": "8C2D5B7F",
        "speed": "480",
    }.items():
        (device / name).write_text(text + "\n")
    for node in ("video0", "video1"):
        folder = tmp_path / "sys" / "class" / "video4linux" / node
        folder.mkdir(parents=True)
        (folder / "name").write_text("ZED: ZED\n")
        (folder / "device").symlink_to(interface)
    return tmp_path / "sys"


@pytest.fixture
def devices(tmp_path: Path) -> Path:
    folder = tmp_path / "dev"
    (folder / "v4l" / "by-id").mkdir(parents=True)
    (folder / "v4l" / "by-path").mkdir()
    for k in (0, 1, 2, 10):
        (folder / f"video{k}").touch()
    (folder / "v4l" / "by-id" / "usb-ZED-video-index0").symlink_to("../../video0")
    (folder / "v4l" / "by-path" / "pci-0-video-index0").symlink_to("../../video0")
    (folder / "v4l" / "by-path" / "pci-2-video-index0").symlink_to("../../video2")
    return folder


def test_what_sysfs_knows(sysfs: Path) -> None:
    assert usb_facts("video0", sysfs) == UsbFacts("2b03:f582", "8C2D5B7F", 480.0)
    assert card_name("video0", sysfs) == "ZED: ZED"
    assert usb_facts("video7", sysfs) == UsbFacts()
    assert card_name("video7", sysfs) is None


def test_a_speed_that_is_no_number_is_not_known(sysfs: Path) -> None:
    (sysfs / "devices" / "usb1" / "1-2" / "speed").write_text("unknown\n")
    assert usb_facts("video0", sysfs).mbit_s is None


def test_cameras_by_stable_path_with_reasons(devices: Path, sysfs: Path) -> None:
    good = CameraEmulator(lambda _: jpeg())
    metadata = CameraEmulator(lambda _: jpeg(), facts=dataclasses.replace(FACTS, captures=False))
    taken = CameraEmulator(lambda _: jpeg(), open_errno=errno.EACCES)
    odd = CameraEmulator(lambda _: jpeg())

    def open_source(path: str) -> VideoSource:
        number = Path(path).resolve().name
        if number == "video10":
            raise RuntimeError("a driver out of its mind")
        return {"video0": good, "video1": metadata, "video2": taken}[number].open(path)

    found = list_cameras(open_source, devices=devices, sysfs=sysfs)
    by_id = str(devices / "v4l" / "by-id" / "usb-ZED-video-index0")
    by_path = str(devices / "v4l" / "by-path" / "pci-2-video-index0")
    node = str(devices / "video10")
    assert [camera.path for camera in found] == [by_id, by_path, node]
    assert (found[0].card, found[0].modes, found[0].problem) == (FACTS.card, MODES, None)
    assert (found[0].serial, found[0].usb_mbit_s) == (FACTS.serial, 480.0)
    assert found[1].problem is not None
    assert "usermod -aG video" in found[1].problem
    assert found[2].problem is not None
    assert "not understood" in found[2].problem
    assert (good.closed, metadata.closed, odd.opened) == (1, 1, 0)


def test_a_camera_that_cannot_be_asked_still_has_its_name(devices: Path, sysfs: Path) -> None:
    def refuse(_: str) -> VideoSource:
        raise OSError(errno.EBUSY, "Device or resource busy")

    first = list_cameras(refuse, devices=devices, sysfs=sysfs)[0]
    assert first.card == "ZED: ZED"
    assert first.problem is not None
    assert "another program uses this camera" in first.problem


def test_a_machine_without_cameras(tmp_path: Path) -> None:
    assert list_cameras(devices=tmp_path, sysfs=tmp_path) == ()
    assert list_cameras(devices=tmp_path / "none", sysfs=tmp_path) == ()


def test_without_linuxpy_cameras_are_listed_with_the_remedy(
    devices: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "linuxpy.video", None)
    found = list_cameras(devices=devices, sysfs=sysfs)
    assert len(found) == 4
    assert all("pip install trackside[v4l2]" in str(camera.problem) for camera in found)
