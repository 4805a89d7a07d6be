"""A film that was not tracked yet, rendered frame by frame, is tracked and joined in one go."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

sys.path.append(str(Path(__file__).parents[2] / "tracking"))

from filmed_run import STILL_S, Run, world

from capture import Session, SessionInfo, write_calibration
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message, imu_message
from capture.session_writer import new_session
from capture.topics import IMAGE_TYPE, IMU_TOPIC, IMU_TYPE, OVERHEAD_TOPIC
from trackside.cli import trackside

OFFSET_NS = 12_345_678_900_000


def filmed(folder: Path, run: Run) -> None:
    with Session.create(folder, SessionInfo(map="arc")):
        pass
    write_calibration(folder / "calibration", world())
    with LogWriter(folder / "overhead.mcap", sync_period_s=None) as log:
        for frame in run.film().frames():
            assert frame.image is not None
            _, jpeg = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
            message = image_message(frame.t_ns, "overhead", "jpeg", jpeg.tobytes())
            log.write(OVERHEAD_TOPIC, IMAGE_TYPE, message, log_t_ns=frame.t_ns, stamp_ns=frame.t_ns)


def recorded(folder: Path, run: Run) -> None:
    """A gyro of 200 Hz, with noise and a bias."""
    at_s = np.arange(0.0, run.frames / 30.0, 0.005)
    driven_s = np.maximum(at_s - STILL_S, 0.0)
    rate = run.turn_rad_s * np.minimum(driven_s / 0.3, 1.0)
    rate = rate + 0.01 + np.random.default_rng(5).normal(0, 3e-3, at_s.size)
    t_ns = run.t_ns[0] + OFFSET_NS + np.rint(at_s * 1e9).astype(np.int64)
    messages = [
        imu_message(one, "imu", (0.0, 0.0, turn), (0.0, 0.0, 9.81))
        for one, turn in zip(t_ns.tolist(), rate.tolist(), strict=True)
    ]
    with new_session(folder, SessionInfo(map="arc")) as writer:
        writer.add_messages(IMU_TOPIC, IMU_TYPE, messages, t_ns)


@pytest.mark.slow
def test_a_film_is_tracked_and_joined_in_one_go(tmp_path: Path) -> None:
    run = Run(frames=130, speed_m_s=0.45, turn_rad_s=1.0)
    filmed(tmp_path / "film", run)
    recorded(tmp_path / "car", run)
    (tmp_path / "scene.yaml").write_text("settle_s: 0.5\n")
    words = ["join", tmp_path / "car", tmp_path / "film", "--scene", tmp_path / "scene.yaml"]
    done = CliRunner().invoke(trackside, [*map(str, words), "--no-clip"])
    assert done.exit_code == 0, done.output
    joined = Session.open(tmp_path / "car_joined")
    clock = joined.info.film_clock
    assert clock is not None
    assert abs(clock.offset_ns - OFFSET_NS) < 2_000_000
    truth = joined.ground_truth()
    rows = np.searchsorted(run.t_ns, truth.path.t_ns - OFFSET_NS + 5_000_000, side="right") - 1
    assert np.abs(truth.path.positions - run.poses[rows, :2]).max() < 2e-3
    assert truth.provenance["verdict"] == "good"
    assert not Session.open(tmp_path / "film").has_ground_truth
    names = {file.name for file in (joined.folder / "ground_truth").iterdir()}
    assert names == {
        "car.tum", "car_covariance.csv", "cones.csv", "ground_truth.yaml", "preview.png",
        "track.html",
    }  # fmt: skip
    again = CliRunner().invoke(
        trackside,
        [*map(str, ["track", joined.folder, "--scene", tmp_path / "scene.yaml", "--replace"]),
         "--no-clip"],
    )  # fmt: skip
    assert again.exit_code == 0, again.output
    # Tracked anew from the joined session, the truth is on the clock of the car as well.
    off_ns = Session.open(joined.folder).ground_truth().path.t_ns - truth.path.t_ns
    assert np.abs(off_ns).max() <= 1
