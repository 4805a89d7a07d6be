from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from capture.clock import UtcLine
from capture.configuration import configuration_from_text
from capture.errors import ConfigurationError
from capture.recording.begin import Take, devices_of, recorder_for
from capture.recording.rig import Rig, read_rig
from capture.recording.rig_file import rig_text
from capture.recording.rig_streams import ON_CAR, streams_of
from capture.session import Session
from capture.session_info import write_session_info
from dialogue import UsageError
from drivers.camera import CameraFound
from drivers.discovery import PortFound

EVERYTHING = """
lidar: {port: /dev/rc/lidar}
vesc: {port: /dev/rc/vesc}
vesc_calibration:
  speed_to_erpm_gain: 4614.0
  steering_angle_to_servo_gain: -1.2135
  steering_angle_to_servo_offset: 0.53
  wheelbase_m: 0.325
razor: {port: /dev/rc/imu}
zed: {path: /dev/rc/zed}
overhead: {path: /dev/v4l/by-id/camera}
"""


def rig(text: str) -> Rig:
    return configuration_from_text(Rig, text, "rig.yaml")


def test_every_device_of_a_rig_becomes_a_stream_and_nothing_is_opened() -> None:
    streams = streams_of(rig(EVERYTHING), [*ON_CAR[:2], "razor", "zed", "overhead"], UtcLine(0, 0))
    rates = {name: stream.asked_hz for name, stream in streams.items()}
    assert rates == {"lidar": 10.0, "vesc": 50.0, "razor": None, "zed": 30.0, "overhead": 30.0}
    assert streams["overhead"].translator.log_name == "overhead.mcap"
    assert streams["zed"].translator.log_name == "zed.mcap"


def test_faults_of_a_rig_are_told_all_at_once_with_their_places() -> None:
    with pytest.raises(ConfigurationError) as caught:
        rig("lidar:\n  prt: /dev/x\nvesc:\n  port: /dev/y\n  rate_hz: 9000\nformat: 7\n")
    text = str(caught.value)
    assert "rig.yaml:2:3: lidar.prt: unknown key; did you mean 'port'?" in text
    assert "rig.yaml:4:3: vesc: rate_hz is more than 0 and at most 500" in text


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("lidar:\n  port: /dev/x\n  rotation_hz: 99.0\n", "rotation_hz"),
        ("mpu9250: {}\nrazor: {}\n", "mpu9250 and razor"),
        ("overhead: {path: /dev/x}\noverhead_video: {file: a.avi}\n", "one camera"),
        ("format: 2\n", "format 2 is not known"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(text: str, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        rig(text)


def test_a_missing_rig_file_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="trackside devices -o"):
        read_rig(tmp_path / "rig.yaml")


def test_what_is_left_out_must_be_there() -> None:
    full = rig(EVERYTHING)
    assert devices_of(full, ON_CAR, ["zed"]) == ("lidar", "vesc", "razor")
    with pytest.raises(UsageError, match=r"--without lidr: no such device.*'lidar'"):
        devices_of(full, ON_CAR, ["lidr"])
    with pytest.raises(UsageError, match="nothing to record"):
        devices_of(rig(""), ON_CAR)


def test_a_recording_knows_what_was_asked_and_how_the_motor_is_calibrated(tmp_path: Path) -> None:
    take = Take("turn", "low", notes="dry")
    recorder = recorder_for(rig(EVERYTHING), ["lidar", "vesc"], take, base=tmp_path)
    assert recorder.folder.name.endswith("_turn_low_1")
    assert (recorder.info.map, recorder.info.trial, recorder.info.notes) == ("turn", 1, "dry")
    write_session_info(recorder.folder, recorder.info)
    session = Session.open(recorder.folder)
    calibration = session.motor_calibration()
    assert calibration is not None
    assert calibration.metres_per_count == pytest.approx(10.0 / 4614.0)
    bare = replace(session.info, configuration={})
    assert replace(session, info=bare).motor_calibration() is None


def test_a_rig_file_is_written_from_what_answered_and_can_be_read() -> None:
    ports = [
        PortFound("/dev/rc/lidar", "/dev/ttyUSB0", kind="lidar", identity={"model": "A2M8"}),
        PortFound("/dev/serial/by-id/x", "/dev/ttyUSB1", kind="lidar"),
        PortFound("/dev/rc/vesc", "/dev/ttyACM0", kind="vesc", identity={"firmware": "5.2"}),
        PortFound("/dev/ttyACM1", "/dev/ttyACM1", problem="nobody answered"),
    ]
    cameras = [
        CameraFound("/dev/v4l/by-id/webcam", "/dev/video0", card="Webcam"),
        CameraFound("/dev/rc/zed", "/dev/video2", card="ZED", usb_id="2b03:f582"),
        CameraFound("/dev/video4", "/dev/video4", problem="no permission"),
    ]
    text = rig_text(ports, cameras, "/dev/i2c-1")
    made = rig(text)
    assert made.lidar is not None
    assert made.lidar.port == "/dev/rc/lidar"
    assert made.vesc_calibration is not None
    assert made.mpu9250 is not None
    assert made.overhead is not None
    assert made.zed is not None
    assert "#   port: /dev/serial/by-id/x" in text
    assert "/dev/video4" not in text
