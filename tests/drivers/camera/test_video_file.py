from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers import DeviceLostError
from drivers.camera import (
    CameraFileError,
    Frame,
    FreeClock,
    Stamp,
    VideoFile,
    VideoFileConfig,
    grey_image,
)

FRAMES, RATE_HZ = 10, 25
WIDTH, HEIGHT = 160, 120


def value(k: int) -> int:
    return 20 + 20 * k


def film(file: Path, codec: str = "MJPG") -> Path:
    """Ten flat frames, each brighter than the one before."""
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*codec), RATE_HZ, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for k in range(FRAMES):
        writer.write(np.full((HEIGHT, WIDTH, 3), value(k), np.uint8))
    writer.release()
    return file


def played(device: VideoFile, timeout_s: float = 1.0) -> list[Frame]:
    frames: list[Frame] = []
    while not device.finished:
        reading = device.read(timeout_s)
        if reading is not None:
            assert (reading.raw, reading.ticks) == ((), ())
            frames += reading.samples
    return frames


@pytest.mark.parametrize(
    ("name", "codec", "image_format", "stamp"),
    [
        ("film.avi", "MJPG", "jpeg", Stamp.FRAME_RATE),  # an AVI knows its rate only
        ("film.mkv", "MJPG", "jpeg", Stamp.CONTAINER),
        ("film.mp4", "mp4v", "bgr8", Stamp.CONTAINER),
    ],
)
def test_frames_and_stamps(
    tmp_path: Path, name: str, codec: str, image_format: str, stamp: Stamp
) -> None:
    device = VideoFile(VideoFileConfig(film(tmp_path / name, codec)), FreeClock(1_000))
    device.connect()
    frames = played(device)
    assert [frame.sequence for frame in frames] == list(range(FRAMES))
    assert {frame.format for frame in frames} == {image_format}
    assert {frame.stamp for frame in frames} == {stamp}
    assert [frame.t_ns - 1_000 for frame in frames] == [k * 40_000_000 for k in range(FRAMES)]
    for k, frame in enumerate(frames):
        assert (frame.width_px, frame.height_px) == (WIDTH, HEIGHT)
        assert np.abs(grey_image(frame).astype(int) - value(k)).max() <= 3
    told = device.identify()
    assert (told["decoded"], told["frames"]) == (image_format == "bgr8", FRAMES)
    assert (told["width_px"], told["height_px"], told["rate_told_hz"]) == (WIDTH, HEIGHT, RATE_HZ)
    assert (device.counters.samples, device.counters.lost_samples) == (FRAMES, 0)
    assert device.read(0.0) is None


def test_the_jpegs_are_those_of_the_file(tmp_path: Path) -> None:
    file = film(tmp_path / "film.avi")
    device = VideoFile(VideoFileConfig(file), FreeClock())
    device.connect()
    content = file.read_bytes()
    assert all(frame.data in content for frame in played(device))


def test_a_cut_jpeg_in_the_middle_is_counted_left_out_and_told(tmp_path: Path) -> None:
    file = film(tmp_path / "film.avi")
    device = VideoFile(VideoFileConfig(file), FreeClock())
    device.connect()
    whole = [frame.data for frame in played(device)]
    content = file.read_bytes()
    # The end of frame 4 is overwritten in place; the container stays sound.
    broken = whole[4][:-20] + b"\x55" * 20
    assert content.count(whole[4]) == 1
    file.write_bytes(content.replace(whole[4], broken))
    device.connect()
    frames = played(device)
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3, 5, 6, 7, 8, 9]
    assert frames[4].t_ns - frames[3].t_ns == 80_000_000
    assert device.counters.bad_frames == 1
    assert device.skipped == [f"{file}: frame 4 left out: cut off: the end mark is missing"]


def test_a_film_that_ends_early_says_how_much_is_missing(tmp_path: Path) -> None:
    file = film(tmp_path / "film.avi")
    device = VideoFile(VideoFileConfig(file), FreeClock())
    device.connect()
    whole = [frame.data for frame in played(device)]
    content = file.read_bytes()
    file.write_bytes(content[: content.index(whole[6]) + 100])  # the power went within frame 6
    device.connect()
    assert [frame.data for frame in played(device)] == whole[:6]
    assert device.counters.bad_frames + device.counters.lost_samples == 4
    assert device.skipped[-1].startswith(f"{file}: ends after ")


class Stampless:
    """A capture whose container tells no time, as some do; rate 0: not even how fast it was."""

    rate_hz = 0.0

    def __init__(self, *how: object) -> None:
        self._video = CAPTURE(*how)

    def __getattr__(self, name: str) -> object:
        return getattr(self._video, name)

    def get(self, key: int) -> float:
        told = {cv2.CAP_PROP_POS_MSEC: 0.0, cv2.CAP_PROP_FPS: self.rate_hz}
        return told.get(key, self._video.get(key))


CAPTURE = cv2.VideoCapture


def test_stamps_that_stand_still_give_way_to_the_rate_or_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = VideoFile(VideoFileConfig(film(tmp_path / "film.mkv")), FreeClock())
    monkeypatch.setattr(cv2, "VideoCapture", Stampless)
    device.connect()
    assert device.read(1.0) is not None
    with pytest.raises(CameraFileError, match=r"frame 1 has no stamp .* stamps\.csv"):
        device.read(1.0)
    monkeypatch.setattr(Stampless, "rate_hz", 25.0)
    device.connect()
    frames = played(device)
    assert [frame.t_ns - frames[0].t_ns for frame in frames] == [k * 40_000_000 for k in range(10)]
    assert {frame.stamp for frame in frames[1:]} == {Stamp.FRAME_RATE}


def test_pace(tmp_path: Path) -> None:
    clock = FreeClock()
    device = VideoFile(VideoFileConfig(film(tmp_path / "film.avi")), clock)
    device.connect()
    assert device.read(0.01) is not None
    assert device.read(0.01) is None
    assert clock.now_ns() == 10_000_000
    assert device.read(0.04) is not None
    assert clock.now_ns() == 40_000_000


def test_connecting_again_begins_anew(tmp_path: Path) -> None:
    device = VideoFile(VideoFileConfig(film(tmp_path / "film.avi")), FreeClock())
    assert (device.identify(), device.name) == ({}, f"video {tmp_path / 'film.avi'}")
    with pytest.raises(DeviceLostError, match="not connected"):
        device.read(0.0)
    device.connect()
    assert device.read(0.0) is not None
    device.close()
    device.close()
    with pytest.raises(DeviceLostError, match="not connected"):
        device.read(0.0)
    device.connect()
    assert len(played(device)) == FRAMES


def test_files_that_are_no_video(tmp_path: Path) -> None:
    with pytest.raises(CameraFileError, match=r"none.avi: there is no such file"):
        VideoFile(VideoFileConfig(tmp_path / "none.avi")).connect()
    (tmp_path / "text.avi").write_text("no video")
    with pytest.raises(CameraFileError, match=r"text.avi: is no video.*ffmpeg -i text.avi"):
        VideoFile(VideoFileConfig(tmp_path / "text.avi")).connect()
