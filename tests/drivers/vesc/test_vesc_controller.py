"""Driving in simulated time: only when armed, within limits, and stopped by every silence."""

from __future__ import annotations

import atexit
import contextlib
import math
import os
import signal
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Device, DeviceFaultError, DeviceLostError, ModelPort, NotArmedError
from drivers.vesc import (
    Drive,
    DriveCommand,
    DriveLimits,
    DrivenMotor,
    Firmware,
    FrameReceiver,
    VescConfig,
    VescController,
    VescModel,
    VescValues,
    emulated_vesc,
)
from drivers.vesc.commands import Kind

MS, S = 1_000_000, 1_000_000_000
LIMITS = DriveLimits(
    erpm_min=-5000, erpm_max=10_000, duty=0.2, current_a=20, brake_a=15, erpm_per_s=10_000
)
STOP = bytes.fromhex("02 05 06 00 00 00 00 CD 85 03")
CONFIG = VescConfig(port="/dev/ttyACM0")

Sample = VescValues | DriveCommand


class Track:
    """A controller, its emulated VESC, and the simulated time that both live in."""

    def __init__(self, firmware: str = "5.03", config: VescConfig = CONFIG) -> None:
        self.model = emulated_vesc(firmware)
        self.port = ModelPort(self.model, name=config.port)
        self.controller = VescController(config, self._open)
        self.samples: list[Sample] = []

    def _open(self, _path: str, _baud: int) -> ModelPort:
        self.port.plug()
        return self.port

    def connected(self) -> Track:
        self.controller.connect()
        self.pass_time(0.1)
        return self

    def pass_time(self, seconds: float) -> None:
        """What the device's thread does meanwhile."""
        end_ns = self.port.now_ns() + round(seconds * 1e9)
        while self.port.now_ns() < end_ns:
            left_s = (end_ns - self.port.now_ns()) * 1e-9
            reading = self.controller.read(min(left_s, 0.1))
            self.samples += reading.samples if reading else ()

    @property
    def commands(self) -> list[DriveCommand]:
        return [sample for sample in self.samples if isinstance(sample, DriveCommand)]

    @property
    def motor(self) -> DrivenMotor:
        assert isinstance(self.model.motor, DrivenMotor)
        return self.model.motor

    def obeyed(self) -> list[tuple[Kind, float]]:
        return [(each.kind, each.value) for each in self.model.obeyed]

    def drive_on(self, drive: Drive, seconds: float, erpm: float = 3000.0) -> None:
        for _ in range(round(seconds / 0.05)):
            drive.rpm(erpm)
            self.pass_time(0.05)


@pytest.fixture
def track() -> Track:
    return Track().connected()


@pytest.mark.parametrize("firmware", ["2.18", "3.40", "5.02", "6.02"])
def test_every_command_reaches_a_vesc_of_every_firmware(firmware: str) -> None:
    track = Track(firmware).connected()
    limits = replace(LIMITS, erpm_per_s=1e9, duty_per_s=1e9, current_a_per_s=1e9, servo_per_s=1e9)
    with track.controller.arm(limits) as drive:
        track.pass_time(0.01)
        for command, value in (
            (drive.servo, 0.6),
            (drive.duty, 0.1),
            (drive.current, -5.5),
            (drive.brake, 3.0),
            (drive.rpm, 4614),
        ):
            command(value)
            track.pass_time(0.01)
        drive.alive()
        if firmware == "2.18":
            with pytest.raises(DeviceFaultError, match="no handbrake"):
                drive.handbrake(1.0)
        else:
            drive.handbrake(1.0)
    assert track.obeyed() == [
        ("servo", 0.6),
        ("duty", 0.1),
        ("current", -5.5),
        ("brake", 3.0),
        ("rpm", 4614),
        ("alive", 0.0),
        *([] if firmware == "2.18" else [("handbrake", 1.0)]),
        *[("current", 0.0)] * 3,
    ]
    assert track.model.dangers == []
    assert track.model.unknown == []


def test_a_car_is_driven_and_the_record_shows_what_was_commanded(track: Track) -> None:
    device: Device[Sample] = track.controller
    assert device.identify()["firmware"] == "5.03"
    with track.controller.arm(LIMITS) as drive:
        drive.servo(0.4)
        track.drive_on(drive, 2.0)
        assert track.motor.erpm == pytest.approx(3000, rel=0.01)
    track.pass_time(0.1)
    times = [sample.t_ns for sample in track.samples]
    # A state is of the moment before it came, a command of when it was sent.
    assert sorted(times) == pytest.approx(times, abs=MS)
    kinds = [command.kind for command in track.commands]
    assert kinds == ["servo", *["rpm"] * 40, "stop"]
    assert track.commands[-1].reason == "the armed block was left"
    assert [command.asked for command in track.commands[1:41]] == [3000.0] * 40
    assert len([sample for sample in track.samples if isinstance(sample, VescValues)]) >= 108
    assert track.controller.counters.timeouts == 0


def test_nothing_moves_without_being_armed(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        pass
    for command in (drive.rpm, drive.duty, drive.current, drive.brake, drive.servo):
        with pytest.raises(NotArmedError, match="the armed block was left; arm it again"):
            command(0.1)
    with pytest.raises(NotArmedError):
        drive.alive()
    assert track.obeyed() == [("current", 0.0)] * 3
    drive.stop()
    assert track.obeyed() == [("current", 0.0)] * 3


def test_arming_needs_a_connection_a_state_and_only_one_block() -> None:
    track = Track()
    with pytest.raises(DeviceLostError, match="connect it first"), track.controller.arm(LIMITS):
        pass
    track.controller.connect()
    with pytest.raises(NotArmedError, match="let a DeviceReader read it"):
        track.controller.arm(LIMITS).__enter__()
    track.pass_time(0.1)
    with (
        track.controller.arm(LIMITS),
        pytest.raises(NotArmedError, match="armed already"),
        track.controller.arm(LIMITS),
    ):
        pass
    track.port.pause(0.6)
    with pytest.raises(NotArmedError, match=r"cannot be armed: the VESC has told nothing for 0\.5"):
        track.controller.arm(LIMITS).__enter__()
    track.pass_time(0.1)
    with track.controller.arm(LIMITS) as drive:
        drive.rpm(0)


def test_a_firmware_that_nobody_knows_is_read_and_not_driven() -> None:
    model = VescModel(Firmware(6, 99))
    model.firmware = Firmware(7, 0)  # as a VESC of the future says
    port = ModelPort(model)
    controller = VescController(CONFIG, lambda _path, _baud: port)
    controller.connect()
    assert controller.read(0.1) is not None
    with pytest.raises(DeviceFaultError, match=r"firmware 7\.00 is not one whose packet ids"):
        controller.arm(LIMITS).__enter__()
    assert model.obeyed == []


def test_a_vesc_with_a_fault_is_not_armed(track: Track) -> None:
    track.model.faults.fault_code = 2
    track.pass_time(0.1)
    with pytest.raises(DeviceFaultError, match="under-voltage; remove its cause"):
        track.controller.arm(LIMITS).__enter__()


# --- everything that stops it


def test_a_program_that_falls_silent_is_stopped_in_time(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 1.0)
        last_ns = track.port.now_ns() - 50 * MS
        track.pass_time(1.0)
        stop = track.commands[-1]
        assert (stop.kind, stop.reason) == ("stop", "no command came for 0.2 s")
        assert 200 * MS <= stop.t_ns - last_ns <= 225 * MS
        with pytest.raises(NotArmedError, match=r"no command came for 0\.2 s"):
            drive.rpm(3000)
    assert track.obeyed()[-3:] == [("current", 0.0)] * 3
    assert track.model.timeouts <= 1  # the VESC's own watchdog came later, if at all


def test_a_late_command_is_not_obeyed_even_if_nobody_watched(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        drive.rpm(3000)
        track.port.pause(0.3)
        with pytest.raises(NotArmedError, match="no command came"):
            drive.rpm(3000)
    assert track.obeyed()[-1] == ("current", 0.0)


def test_steering_alone_does_not_keep_the_motor_driving(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        for _ in range(20):  # standing, it keeps the block armed
            drive.servo(0.5)
            track.pass_time(0.1)
        drive.rpm(3000)
        drive.servo(0.5)
        track.pass_time(0.15)
        drive.servo(0.5)
        track.pass_time(0.1)
        assert drive.why_stopped == "no command came for 0.2 s"


def test_alive_keeps_the_last_command(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.2, 500)
        for _ in range(20):
            track.pass_time(0.1)
            drive.alive()
        assert track.motor.erpm == pytest.approx(500)
        assert track.model.timeouts == 0
    assert drive.why_stopped == "the armed block was left"


def test_the_vesc_s_own_watchdog_is_there_when_all_of_us_hang(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 1.0)
        track.port.pause(3.0)  # neither the user's program nor the reader runs
        assert track.model.timeouts == 1
        coasting = track.motor.values(track.port.now_ns())
        assert coasting.erpm == pytest.approx(3000 * math.exp(-2.05 / 0.8), rel=0.01)


@pytest.mark.parametrize("kind", ["rpm", "duty", "current", "brake", "handbrake", "servo"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_stops_the_car(track: Track, kind: str, value: float) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.2)
        stop = getattr(drive, kind)(value)
        assert (stop.kind, stop.reason) == ("stop", f"{kind} was {value}")
        with pytest.raises(NotArmedError, match=str(value)):
            drive.rpm(100)
    assert track.obeyed()[-1] == ("current", 0.0)


def test_an_exception_stops_the_car(track: Track) -> None:
    def crash() -> None:
        with track.controller.arm(LIMITS) as drive:
            track.drive_on(drive, 0.5)
            _ = 1 / 0

    with pytest.raises(ZeroDivisionError):
        crash()
    assert bytes(track.port.written).endswith(STOP * 3)


def test_sigterm_leaves_the_block_and_stops_the_car(track: Track) -> None:
    before = signal.getsignal(signal.SIGTERM)

    def drive_until_told() -> None:
        with track.controller.arm(LIMITS) as drive:
            track.drive_on(drive, 0.5)
            os.kill(os.getpid(), signal.SIGTERM)
            pytest.fail("the signal must leave the block at once")

    with pytest.raises(SystemExit) as left:
        drive_until_told()
    assert left.value.code == 143
    assert bytes(track.port.written).endswith(STOP * 3)
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_second_sigterm_does_not_interrupt_the_stop(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        for expected in (pytest.raises(SystemExit), contextlib.nullcontext()):
            with expected:
                os.kill(os.getpid(), signal.SIGTERM)
        drive.rpm(100)
    assert bytes(track.port.written).endswith(STOP * 3)


def test_sigterm_of_a_program_that_handles_it_is_left_alone(track: Track) -> None:
    got: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _frame: got.append(number))
    try:
        with track.controller.arm(LIMITS) as drive:
            os.kill(os.getpid(), signal.SIGTERM)
            drive.rpm(100)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert got == [signal.SIGTERM]


def test_the_interpreter_s_exit_stops_the_car(
    track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a thread that is still in its armed block then: daemons are never unwound."""
    at_exit: list[tuple[Callable[..., object], tuple[object, ...]]] = []
    monkeypatch.setattr(atexit, "register", lambda call, *args: at_exit.append((call, args)))
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.5)
        ((call, args),) = at_exit
        call(*args)
        assert drive.why_stopped == "the program ended"
        assert bytes(track.port.written).endswith(STOP * 3)


def test_closing_stops_the_car_and_a_new_connection_is_disarmed(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.5)
        track.controller.close()
        track.controller.close()
        assert track.port.closed
        assert bytes(track.port.written).endswith(STOP * 3)
        with pytest.raises(NotArmedError, match="the port was closed"):
            drive.rpm(100)
        track.connected()
        with pytest.raises(NotArmedError):
            drive.rpm(100)


def test_a_vesc_that_falls_silent_is_stopped_before_it_counts_as_lost(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.5)
        track.model.faults.silent = True
        with pytest.raises(NotArmedError, match=r"told nothing for 0\.5 s"):
            track.drive_on(drive, 5.0)
        assert track.obeyed()[-1] == ("current", 0.0)  # it hears, though it does not speak
        with pytest.raises(DeviceLostError, match="unanswered"):
            track.pass_time(5.0)


def test_a_fault_of_the_vesc_ends_the_block(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.5)
        track.model.faults.fault_code = 4
        with pytest.raises(NotArmedError, match="absolute over-current"):
            track.drive_on(drive, 0.5)
    assert track.obeyed()[-1] == ("current", 0.0)


def test_a_pulled_cable_is_told_and_the_stop_is_noted_as_not_delivered(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.5)
        track.port.unplug()
        with pytest.raises(DeviceLostError, match="plug it in again"):
            drive.rpm(3000)
        assert "could not be sent" in str(drive.why_stopped)
    with pytest.raises(DeviceLostError):
        track.controller.read(0.1)
    track.connected()  # the record of it comes with the first reading there is
    assert track.commands[-1].kind == "stop"
    assert "the stop was not delivered" in track.commands[-1].reason


def test_an_error_while_reading_stops_the_car(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 0.2)
        track.port.unplug()
        with pytest.raises(DeviceLostError):
            track.pass_time(0.1)
        assert "cannot be read" in str(drive.why_stopped)


def test_the_stop_may_brake(track: Track) -> None:
    with track.controller.arm(replace(LIMITS, stop_brake_a=8.0)) as drive:
        track.drive_on(drive, 0.5)
    assert track.obeyed()[-3:] == [("brake", 8.0)] * 3


# --- limits


def test_a_command_is_held_inside_its_limits(track: Track) -> None:
    fast = replace(LIMITS, erpm_per_s=1e9, duty_per_s=1e9, current_a_per_s=1e9, servo_per_s=1e9)
    with track.controller.arm(fast) as drive:
        for command, asked, limit in (
            (drive.rpm, 1e6, 10_000),
            (drive.rpm, -1e6, -5000),
            (drive.duty, 0.9, 0.2),
            (drive.duty, -0.9, -0.2),
            (drive.current, 1e3, 20),
            (drive.current, -1e3, -20),
            (drive.brake, 99, 15),
            (drive.brake, -5, 0),
            (drive.handbrake, 99, 15),
            (drive.servo, 0.0, 0.15),
            (drive.servo, 1.0, 0.85),
        ):
            track.pass_time(0.01)
            done = command(asked)
            assert (done.asked, done.sent) == (asked, limit)


def test_speed_grows_no_faster_than_allowed_and_falls_at_once(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        sent = []
        for _ in range(20):
            track.pass_time(0.1)
            sent.append(drive.rpm(8000).sent)
        assert sent[:8] == pytest.approx([1000.0 * n for n in range(1, 9)], rel=0.01)
        assert sent[-1] == 8000
        assert drive.rpm(500).sent == 500
        track.pass_time(0.1)
        assert drive.rpm(-8000).sent == pytest.approx(-1000)  # through zero, then as slowly


def test_a_rolling_car_is_taken_at_its_speed(track: Track) -> None:
    track.motor.erpm = 6000.0
    track.pass_time(0.05)
    with track.controller.arm(LIMITS) as drive:
        track.pass_time(0.02)
        assert drive.rpm(9000).sent == pytest.approx(5800, abs=400)


def test_steering_is_limited_in_speed_both_ways(track: Track) -> None:
    with track.controller.arm(replace(LIMITS, servo_per_s=1.0)) as drive:
        drive.servo(0.5)
        track.pass_time(0.1)
        assert drive.servo(0.85).sent == pytest.approx(0.6)
        track.pass_time(0.1)
        assert drive.servo(0.15).sent == pytest.approx(0.5)


@given(
    st.lists(st.tuples(st.floats(-20_000, 20_000), st.floats(0.0, 0.5)), min_size=1, max_size=30),
    st.floats(-20_000, 20_000),
)
def test_no_sequence_of_commands_breaks_a_limit(
    steps: list[tuple[float, float]], start: float
) -> None:
    before = start
    for asked, seconds in steps:
        sent = LIMITS.held("rpm", asked, before, seconds)
        assert LIMITS.erpm_min <= sent <= LIMITS.erpm_max
        assert abs(sent) <= abs(asked)
        assert abs(sent) - abs(before) <= LIMITS.erpm_per_s * seconds + 1e-6
        if sent * before < 0:
            assert abs(sent) <= LIMITS.erpm_per_s * seconds + 1e-6
        before = sent


@pytest.mark.parametrize(
    "change",
    [
        {"erpm_max": math.nan},
        {"erpm_min": 1.0},
        {"duty": 1.5},
        {"current_a": -1.0},
        {"servo_min": 0.9},
        {"servo_max": 1.5},
        {"heartbeat_s": 0.0},
        {"heartbeat_s": 2.0},
        {"telemetry_s": math.inf},
        {"stop_brake_a": 16.0},
    ],
)
def test_limits_that_are_none(change: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(change))):
        replace(LIMITS, **change)


def test_a_logger_s_frames_and_the_commands_are_never_mixed(track: Track) -> None:
    with track.controller.arm(LIMITS) as drive:
        track.drive_on(drive, 1.0)
    receiver = FrameReceiver()
    receiver.feed(bytes(track.port.written))
    assert (receiver.bad_bytes, receiver.bad_frames) == (0, 0)
