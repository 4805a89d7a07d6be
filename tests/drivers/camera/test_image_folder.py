from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from camera_pictures import encoded, jpeg

from drivers import DeviceLostError
from drivers.camera import (
    CameraFileError,
    Frame,
    FreeClock,
    ImageFolder,
    ImageFolderConfig,
    Stamp,
    grey_image,
)

PNG = encoded(np.full((48, 64), 7, np.uint8), ".png")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Five images; names sort as 01, 02, 03, 10, 11."""
    for name in ("10", "02", "01", "11"):
        (tmp_path / f"image{name}.jpg").write_bytes(jpeg(64, 48, int(name)))
    (tmp_path / "image03.PNG").write_bytes(PNG)
    (tmp_path / "notes.txt").write_text("no image")
    return tmp_path


def played(device: ImageFolder, timeout_s: float = 0.0) -> list[Frame]:
    """All frames until the end."""
    frames: list[Frame] = []
    while not device.finished:
        reading = device.read(timeout_s)
        if reading is not None:
            assert (reading.raw, reading.ticks) == ((), ())
            frames += reading.samples
    return frames


def test_images_come_in_the_order_of_their_names_as_they_are(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), FreeClock())
    device.connect()
    frames = played(device, 1.0)
    assert [frame.format for frame in frames] == ["jpeg", "jpeg", "png", "jpeg", "jpeg"]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3, 4]
    assert frames[0].data == (folder / "image01.jpg").read_bytes()
    assert frames[2].data == PNG
    assert {(frame.width_px, frame.height_px) for frame in frames} == {(64, 48)}
    assert device.counters.samples == 5
    assert device.read(0.0) is None


def test_stamps_made_from_a_rate_say_so(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=30.0), FreeClock(5_000))
    device.connect()
    frames = played(device, 1.0)
    assert {frame.stamp for frame in frames} == {Stamp.FRAME_RATE}
    assert [frame.t_ns - 5_000 for frame in frames] == [round(k * 1e9 / 30) for k in range(5)]
    assert device.identify()["stamps_by"] == Stamp.FRAME_RATE.value


def test_listed_stamps_keep_their_differences(folder: Path) -> None:
    names = ["image01.jpg", "image02.jpg", "image03.PNG", "image10.jpg", "image11.jpg"]
    listed = [1_700_000_000_000_000_000 + t for t in (0, 33_000_001, 70_000_000, 99, 200_000_000)]
    listed[3] = listed[2] + 1
    rows = [f"{name},{t_ns}" for name, t_ns in zip(names, listed, strict=True)]
    (folder / "stamps.csv").write_text("\n".join(["name,t_ns", *reversed(rows), ""]))
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), FreeClock(100))
    device.connect()
    frames = played(device, 1.0)
    assert {frame.stamp for frame in frames} == {Stamp.LISTED}
    assert [frame.t_ns - 100 for frame in frames] == [t_ns - listed[0] for t_ns in listed]
    assert device.identify()["first_stamp_ns"] == listed[0]


def test_the_clock_sets_the_pace(folder: Path) -> None:
    clock = FreeClock()
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), clock)
    device.connect()
    assert device.read(0.01) is not None
    assert device.read(0.06) is None
    assert clock.now_ns() == 60_000_000
    reading = device.read(0.06)
    assert reading is not None
    assert (reading.samples[0].t_ns, reading.samples[0].arrival_ns) == (100_000_000, 100_000_000)


def test_late_readers_get_the_frames_stamps_and_not_their_own(folder: Path) -> None:
    clock = FreeClock()
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), clock)
    device.connect()
    assert device.read(0.0) is not None
    clock.pause(10.0)
    assert [frame.t_ns for frame in played(device)] == [100_000_000 * k for k in (1, 2, 3, 4)]


def test_real_time_is_the_machines(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=500.0))
    device.connect()
    frames = played(device, 0.001)
    assert len(frames) == 5
    assert all(0 <= frame.arrival_ns - frame.t_ns < 1_000_000_000 for frame in frames)
    assert frames[-1].arrival_ns - frames[0].arrival_ns >= 7_900_000


def test_as_fast_as_possible_needs_no_time(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=0.001, real_time=False))
    device.connect()
    assert [frame.t_ns for frame in played(device, 1e6)] == [10**12 * k for k in range(5)]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (jpeg(64, 48)[:-100], "cut off: the end mark is missing"),
        (PNG[:40], "cut off: the end chunk is missing"),
        (b"", "no image"),
        (b"<html>", "no image"),
    ],
)
def test_a_corrupt_image_is_counted_left_out_and_told(folder: Path, data: bytes, why: str) -> None:
    (folder / "image02.jpg").write_bytes(data)
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), FreeClock())
    device.connect()
    frames = played(device, 1.0)
    assert [frame.sequence for frame in frames] == [0, 2, 3, 4]
    assert [frame.t_ns for frame in frames] == [0, 200_000_000, 300_000_000, 400_000_000]
    assert device.counters.bad_frames == 1
    (told,) = device.skipped
    assert told.startswith(f"{folder / 'image02.jpg'}: left out: {why}")


def test_an_image_that_vanishes_is_told(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), FreeClock())
    device.connect()
    (folder / "image11.jpg").unlink()
    assert len(played(device, 1.0)) == 4
    assert "image11.jpg: left out: cannot be read: No such file" in device.skipped[0]


def test_connecting_again_begins_anew(folder: Path) -> None:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=10.0), FreeClock())
    with pytest.raises(DeviceLostError, match="not connected"):
        device.read(0.0)
    device.connect()
    assert device.read(0.0) is not None
    device.close()
    device.close()
    assert not device.finished
    with pytest.raises(DeviceLostError, match="not connected"):
        device.read(0.0)
    device.connect()
    assert len(played(device, 1.0)) == 5


def refused(folder: Path, rate_hz: float | None = None) -> str:
    device = ImageFolder(ImageFolderConfig(folder, rate_hz))
    with pytest.raises(CameraFileError) as caught:
        device.connect()
    assert device.identify() == {}
    return str(caught.value)


def test_folders_that_are_no_camera(folder: Path, tmp_path: Path) -> None:
    assert "is no folder" in refused(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    assert "holds no images; .jpg, .jpeg, .png were expected" in refused(tmp_path / "empty", 10.0)
    assert "write stamps.csv (name,t_ns) beside them, or give rate_hz" in refused(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "stamps.csv:1: the first line must be `name,t_ns`"),
        ("file,time\n", "stamps.csv:1: the first line must be `name,t_ns`"),
        ("name,t_ns\na.jpg,1\nb.jpg,2.5\n", "stamps.csv:3: 'b.jpg,2.5' is not an image's name"),
        ("name,t_ns\na.jpg\n", "stamps.csv:2: 'a.jpg' is not an image's name"),
        ("name,t_ns\na.jpg,1\n\na.jpg,2\n", "stamps.csv:4: a.jpg is listed twice"),
        ("name,t_ns\na.jpg,1\n", "1 images are not listed (b.jpg is the first)"),
        ("name,t_ns\na.jpg,2\nb.jpg,2\n", "b.jpg is stamped 2, not after a.jpg (2)"),
        ("name,t_ns\n\xff\x00\n", "stamps.csv"),
    ],
)
def test_faults_of_the_stamps_name_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    for name in ("a.jpg", "b.jpg"):
        (tmp_path / name).write_bytes(jpeg(64, 48))
    (tmp_path / "stamps.csv").write_bytes(text.encode("latin-1"))
    assert message in refused(tmp_path, 10.0)


def test_no_frame_rate() -> None:
    with pytest.raises(ValueError, match="rate_hz 0 is no frame rate"):
        ImageFolderConfig(Path("x"), rate_hz=0.0)


@pytest.mark.realdata
def test_real_photographs_of_a_chessboard(data_dir: Path) -> None:
    folder = data_dir / "calibration_left"
    device = ImageFolder(ImageFolderConfig(folder, rate_hz=1.0), FreeClock())
    device.connect()
    frames = played(device, 2.0)
    assert [frame.sequence for frame in frames] == list(range(14))
    assert {(f.format, f.width_px, f.height_px) for f in frames} == {("jpeg", 640, 480)}
    assert all(grey_image(frame).shape == (480, 640) for frame in frames)
    assert device.skipped == []


@pytest.mark.realdata
def test_real_frames_of_a_lab_jpeg_and_png(data_dir: Path) -> None:
    device = ImageFolder(ImageFolderConfig(data_dir / "whycon", rate_hz=1.0), FreeClock())
    device.connect()
    frames = played(device, 2.0)
    assert [(f.format, f.width_px, f.height_px) for f in frames] == [
        ("jpeg", 1520, 1029),
        ("png", 1280, 720),
        ("png", 1280, 720),
    ]
    assert all(grey_image(f).shape == (f.height_px, f.width_px) for f in frames)
