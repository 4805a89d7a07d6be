from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import Browser, faults
from click.testing import CliRunner, Result
from filmed_run import RATE_HZ, Run, world

from capture import Session, SessionInfo, write_calibration
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE, OVERHEAD_TOPIC
from geometry import wrap
from trackside.cli import trackside

CUT = 30


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


def filmed_session(folder: Path, run: Run) -> Path:
    """A session as `trackside film` leaves it; the JPEG of frame `CUT` is cut off."""
    with Session.create(folder, SessionInfo(map="arc", power="low", trial=1)):
        pass
    with LogWriter(folder / "overhead.mcap", sync_period_s=None) as log:
        for frame in run.film().frames():
            assert frame.image is not None
            _, jpeg = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
            data = jpeg.tobytes()
            data = data[: len(data) // 2] if frame.sequence == CUT else data
            message = image_message(frame.t_ns, "overhead", "jpeg", data)
            arrived = frame.t_ns + 20_000_000
            log.write(OVERHEAD_TOPIC, IMAGE_TYPE, message, log_t_ns=arrived, stamp_ns=frame.t_ns)
    return folder


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration and a tracked session."""
    folder = tmp_path_factory.mktemp("site")
    write_calibration(folder / "calibration", world())
    (folder / "scene.yaml").write_text("settle_s: 0.5\n")
    filmed_session(folder / "run", Run(frames=55))
    done = call("track", folder / "run", *flags(folder))
    assert done.exit_code == 0, done.output
    assert "good" in done.output
    assert "frames: 55, 1 of them left out" in done.output
    assert f"note: 1 frames left out, damaged: {CUT}" in done.output
    # A film alone has nothing to run SLAM on.
    assert f"next: trackside join CAR {folder / 'run'}" in done.output
    return folder


def flags(folder: Path) -> list[object]:
    return ["--calibration", folder / "calibration", "--scene", folder / "scene.yaml"]


def test_the_session_has_its_truth_with_covariances_and_how_it_was_made(site: Path) -> None:
    run, session = Run(frames=55), Session.open(site / "run")
    truth = session.ground_truth()
    rows = np.searchsorted(run.t_ns, truth.path.t_ns)
    off = truth.path.poses - run.poses[rows]
    assert np.abs(off[:, :2]).max() < 5e-4
    assert np.abs(wrap(off[:, 2])).max() < 3e-3
    assert truth.landmarks is not None
    assert len(truth.landmarks) == 3
    assert truth.path_covariances is not None
    assert truth.bridged is not None
    assert truth.bridged.shape == (len(truth.path),)
    assert not truth.bridged.any()
    assert truth.provenance["verdict"] == "good"
    assert truth.provenance["damaged_frames"] == 1
    assert [file.name for file in session.calibrations] == [
        file.name for file in (site / "calibration").glob("world_*.yaml")
    ]


def test_pictures_are_made(site: Path) -> None:
    folder = site / "run" / "ground_truth"
    preview = cv2.imread(str(folder / "preview.png"))
    assert preview is not None
    assert preview.shape == (720, 960, 3)
    clip = cv2.VideoCapture(str(folder / "track.mp4"))
    assert int(clip.get(cv2.CAP_PROP_FRAME_COUNT)) == 54
    clip.release()
    page = (folder / "track.html").read_text()
    assert page.count("<svg") == 3
    assert 'src="data:image/jpeg;base64,' in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert f"damaged: {CUT}" in page


def test_a_browser_shows_the_page_without_a_fault(browser: Browser, site: Path) -> None:
    assert faults(browser, site / "run" / "ground_truth" / "track.html") == []


def test_the_page_of_a_bad_run_names_the_reasons(browser: Browser, site: Path) -> None:
    filmed_session(site / "hidden", Run(frames=50, occluded=(22, 48)))
    done = call("track", site / "hidden", *flags(site), "--no-clip")
    page = site / "hidden" / "ground_truth" / "track.html"
    shown = browser.look(page, 390).dom
    reasons = [line.strip() for line in done.output.partition("\nbad\n")[2].splitlines()]
    reasons = [line for line in reasons if line and line in shown]
    assert reasons, done.output
    assert faults(browser, page) == []


def test_a_truth_is_replaced_only_when_asked(site: Path) -> None:
    again = call("track", site / "run", *flags(site))
    assert "has a ground truth already" in str(again.exception)


def test_old_footage_becomes_a_session(site: Path, tmp_path: Path) -> None:
    run, file = Run(frames=45), tmp_path / "old.avi"
    video = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (960, 720), True)
    for frame in run.film().frames():
        assert frame.image is not None
        video.write(cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR))
    video.release()
    done = call("track", "--video", file, *flags(site), "--no-clip")
    assert done.exit_code == 0, done.output
    session = Session.open(tmp_path / "old_session")
    truth = session.ground_truth()
    np.testing.assert_allclose(truth.path.positions, run.poses[: len(truth.path), :2], atol=2e-3)
    assert "frame rate" in str(truth.provenance["stamps"])
    assert not (tmp_path / "old_session" / "ground_truth" / "track.mp4").exists()


def test_words_that_do_not_fit_are_told(site: Path, tmp_path: Path) -> None:
    assert "either a SESSION" in str(call("track").exception)
    both = call("track", site / "run", "--video", "x.avi")
    assert "either a SESSION" in str(both.exception)
    with Session.create(tmp_path / "empty", SessionInfo()):
        pass
    none = call("track", tmp_path / "empty", *flags(site))
    assert "has no pictures of the overhead camera" in str(none.exception)
    nowhere = call("track", site / "run", "--replace", "--calibration", tmp_path / "nowhere")
    assert "trackside calibrate world makes one" in str(nowhere.exception)
