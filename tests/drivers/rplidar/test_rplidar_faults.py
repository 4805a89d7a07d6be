"""What goes wrong with a lidar on a car, each with what the driver makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lidar_bench import Bench, on_our_clock

from drivers import (
    Chunk,
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    Line,
    ModelPort,
    NoAnswerError,
    ProtocolError,
)
from drivers.rplidar import RPLidar, RPLidarConfig, RPLidarModel, a2m8, replay, room
from drivers.rplidar.emulator import BOOST, EXPRESS, STANDARD, LidarSpec
from drivers.rplidar.protocol import ScanMode

ALL = pytest.mark.parametrize("mode", ["Standard", "Express", "Boost"])


def running(mode: str, seconds: float = 3.5, **rest: object) -> Bench:
    one = Bench(config=RPLidarConfig("/dev/lidar", scan_mode=mode))
    one.model = RPLidarModel(**rest)  # type: ignore[arg-type]  # named by each test
    one.connected().run(seconds)
    return one


def assert_true(one: Bench) -> None:
    """Every turn's times are those of the model, to a tenth of a millisecond; epoch for epoch."""
    shape = room()
    for turn in one.turns:
        t_ns = on_our_clock(one.ticks, turn)
        off_m = np.abs(turn.range_m - shape(turn.device_ns, turn.bearing_rad))
        # One damaged distance in a turn cannot be told from a good one in standard nodes.
        assert np.sort(off_m[~np.isnan(turn.range_m)])[-2] < 0.02
        true_ns = one.model.true_ns(np.arange(200_000))
        nearest = true_ns[np.clip(np.searchsorted(true_ns, t_ns), 1, len(true_ns) - 1)]
        before = true_ns[np.clip(np.searchsorted(true_ns, t_ns) - 1, 0, len(true_ns) - 1)]
        assert np.minimum(np.abs(nearest - t_ns), np.abs(before - t_ns)).max() < 100_000


class Talker:
    """A device that is no lidar: it says something all the time, or nothing."""

    def __init__(self, says: bytes, period_ns: int = 20_000_000) -> None:
        self.line, self.says, self.period_ns, self.sent_ns = Line(115200), says, period_ns, 0
        self.received = bytearray()

    def receive(self, data: bytes, now_ns: int) -> None:
        del now_ns
        self.received += data

    def transmit(self, now_ns: int) -> bytes:
        while self.says and self.sent_ns <= now_ns:
            self.line.send(self.says, self.sent_ns)
            self.sent_ns += self.period_ns
        return self.line.due(now_ns)

    def next_ns(self) -> int | None:
        return self.line.next_ns() or (self.sent_ns if self.says else None)


@pytest.mark.parametrize(
    ("says", "period_ns", "text"),
    [
        (b"", 1, r"no RPLidar answers at 115200, 256000, .*the line is silent.*trackside devices"),
        (
            b"\x02\x38\x04\x00\x01",
            20_000_000,
            r"bytes come: 02 38 04.*perhaps a VESC.*another port",
        ),
        (b"#YPR=1.0,2.0,3.0\r\n", 20_000_000, r"text, perhaps an IMU"),
        (b"\xff\x00\x81\x99" * 40, 4_000_000, r"bytes come: .*something else"),
    ],
)
def test_no_lidar_on_the_port_is_told_with_its_remedy(
    says: bytes, period_ns: int, text: str
) -> None:
    talker = Talker(says, period_ns)
    port = ModelPort(talker, name="/dev/ttyACM0")
    lidar = RPLidar(RPLidarConfig("/dev/ttyACM0"), lambda _path, _baud: port)
    with pytest.raises(NoAnswerError, match=text):
        lidar.connect()
    assert port.now_ns() < 5_000_000_000
    assert port.closed
    # A stranger got nothing but questions: no motor command.
    assert b"\xf0" not in talker.received


def test_a_speed_that_is_given_and_wrong_is_told() -> None:
    spec = replace(a2m8(), baud=256000)
    one = Bench(RPLidarModel(spec), RPLidarConfig("/dev/lidar", baud=115200))
    with pytest.raises(NoAnswerError, match=r"no RPLidar answers at 115200 baud"):
        one.lidar.connect()


@pytest.mark.parametrize("left", [STANDARD, EXPRESS, BOOST])
@pytest.mark.parametrize("baud", [115200, 256000])
def test_a_scan_that_a_dead_program_left_is_stopped(left: ScanMode, baud: int) -> None:
    one = Bench(RPLidarModel(replace(a2m8(), baud=baud)))
    one.model.left_scanning(left, 0)
    one.now_ns = 7_777_777_777
    one.connected().run(1.5)
    assert len(one.turns) >= 10
    assert one.lidar.counters.bad_bytes == 0


def test_a_lidar_that_still_boots_is_waited_for() -> None:
    one = Bench()
    one.model.receive(b"\xa5\x40", 0)
    one.connected().run(3.0)
    assert one.turns


def test_protection_stop_is_cured_by_a_reset() -> None:
    one = Bench()
    one.model.faults.protection_stop = True
    one.connected().run(3.0)
    assert one.turns
    assert bytes(one.port.written).count(b"\xa5\x40") == 1


def test_protection_stop_that_stays_is_told() -> None:
    one = Bench()
    one.model.faults.protection_stop = True
    one.model.faults.reset_cures = False
    with pytest.raises(DeviceFaultError, match=r"protection stop \(code 0x8001\).*unplug it"):
        one.lidar.connect()
    assert one.port.now_ns() < 5_000_000_000
    assert one.port.closed


def test_a_lidar_that_stops_answering_in_between_is_told() -> None:
    class Dying(RPLidarModel):
        def receive(self, data: bytes, now_ns: int) -> None:
            super().receive(data, now_ns)
            self.faults.silent = data == b"\xa5\x52"

    one = Bench(Dying())
    with pytest.raises(NoAnswerError, match=r"A2M8 said who it is and then stopped answering"):
        one.lidar.connect()
    assert one.port.now_ns() < 5_000_000_000
    assert one.lidar.counters.timeouts == 1


def test_no_answers_that_we_decode_is_a_fault_of_the_device() -> None:
    class Strange(RPLidarModel):
        def _conf(self, payload: bytes) -> bytes:
            answer = super()._conf(payload)
            return answer[:4] + b"\x83" if payload[0] == 0x75 else answer

    one = Bench(Strange())
    with pytest.raises(DeviceFaultError, match=r"Standard, Express, .*none with answers"):
        one.lidar.connect()


def test_a_scan_of_another_type_than_announced_is_decoded_as_it_comes() -> None:
    class Lying(RPLidarModel):
        def _conf(self, payload: bytes) -> bytes:
            answer = super()._conf(payload)
            return answer.replace(b"\x84", b"\x82") if payload[0] == 0x75 else answer

    one = Bench(Lying()).connected()
    assert one.lidar.identify()["answer_type"] == "0x84"
    one.run(3.0)
    assert one.turns


def test_a_head_that_does_not_turn_is_told_after_its_time() -> None:
    one = Bench(RPLidarModel(replace(a2m8(), pwm_per_hz=1e12))).connected()
    one.model.rotor.drive(0.0, one.port.now_ns())
    begun_ns = one.port.now_ns()
    with pytest.raises(NoAnswerError, match="no beam came in 6 s; the head does not turn"):
        one.run(10.0)
    assert 5.0 < (one.port.now_ns() - begun_ns) * 1e-9 < 6.5


@ALL
def test_silence_in_a_scan_is_a_lost_device(mode: str) -> None:
    one = running(mode)
    one.model.faults.silent = True
    since_ns = one.port.now_ns()
    with pytest.raises(DeviceLostError, match=r"silent for 1 s.*cable"):
        one.run(5.0)
    assert (one.port.now_ns() - since_ns) * 1e-9 < 1.3
    one.model.faults.silent = False
    one.lidar.close()
    one.connected().run(2.0)
    assert {turn.epoch for turn in one.turns} == {0, 1}


@ALL
def test_a_pulled_cable_is_a_lost_device_and_closing_is_calm(mode: str) -> None:
    one = running(mode)
    one.port.unplug()
    with pytest.raises(DeviceLostError):
        one.run(1.0)
    one.lidar.close()
    assert one.port.closed


def test_a_cable_pulled_while_connecting() -> None:
    one = Bench()

    def open_port(path: str, baud: int) -> object:
        port = one.open(path, baud)
        port.unplug()
        return port

    lidar = RPLidar(one.config, open_port)  # type: ignore[arg-type]  # a port all the same
    with pytest.raises(DriverError):
        lidar.connect()
    assert one.port.closed


@ALL
def test_nonsense_for_two_seconds_is_an_error(mode: str) -> None:
    rng = np.random.default_rng(0)
    noise = [Chunk(i * 5_000_000, rng.integers(0, 256, 50, np.uint8).tobytes()) for i in range(999)]
    modes = {"Standard": STANDARD, "Express": EXPRESS, "Boost": BOOST}
    spec = LidarSpec(a2m8().info, (modes[mode],))
    one = Bench(RPLidarModel(spec, replay=replay(noise))).connected()
    with pytest.raises(ProtocolError, match=r"for 2 s nothing that came was a piece of a scan"):
        one.run(5.0)
    assert one.lidar.counters.bad_frames > 0


@ALL
@pytest.mark.parametrize("lost", [1, 4, 131, 700])
def test_lost_bytes_cost_a_turn_at_most_and_no_time_stamp(mode: str, lost: int) -> None:
    one = running(mode)
    before = len(one.turns)
    one.model.faults.drop_bytes = lost
    one.run(1.5)
    assert len(one.turns) - before >= 12
    assert one.lidar.counters.lost_samples + one.lidar.counters.details["epochs"] > 0
    assert_true(one)


def test_whole_nodes_lost_without_a_trace_are_noticed_by_the_time_they_took() -> None:
    one = running("Standard")
    one.model.faults.drop_bytes = 12 * 5
    one.run(0.6)
    turns = len(one.turns)
    assert one.lidar.counters.details["epochs"] == 1
    one.run(1.0)
    assert one.lidar.counters.details["epochs"] == 1
    one.turns = one.turns[turns + 1 :]
    assert len(one.turns) >= 8
    assert_true(one)


@ALL
def test_turned_bits_cost_single_packets(mode: str) -> None:
    one = running(mode)
    before = len(one.turns)
    for _ in range(20):
        one.model.faults.flip_bits = 1
        one.run(0.2)
    assert len(one.turns) - before >= 33
    assert one.lidar.counters.details["epochs"] == 0
    assert_true(one)


@pytest.mark.parametrize("mode", ["Express", "Boost"])
def test_an_unsteady_rotation_begins_a_new_epoch(mode: str) -> None:
    one = running(mode)
    one.model.faults.restart = True
    one.run(1.0)
    assert {turn.epoch for turn in one.turns} == {0, 1}
    assert one.lidar.counters.details["epochs"] == 1
    assert_true(one)


@ALL
def test_noise_in_the_stream_is_skipped_and_counted(mode: str) -> None:
    one = running(mode)
    one.model.faults.noise = bytes(range(1, 200))
    one.run(1.5)
    assert one.lidar.counters.bad_bytes > 0
    assert len(one.turns) > 15
    assert_true(one)


@ALL
def test_a_rotation_that_changes_is_followed(mode: str) -> None:
    one = running(mode)
    one.model.rotor.jump(11.0, one.port.now_ns())
    one.run(0.8)
    assert one.turns[-1].period_s == pytest.approx(1.0 / 11.0, rel=0.02)
    one.model.rotor.drive(6.0, one.port.now_ns())
    one.run(1.0)
    assert one.lidar.counters.lost_samples == 0
    assert one.turns[-1].period_s > 0.12
    assert_true(one)


@pytest.mark.parametrize("mode", ["Standard", "Express", "Boost"])
@pytest.mark.parametrize("stall_s", [0.1, 0.3, 1.0])
def test_a_reader_that_comes_too_late_loses_what_the_kernel_cannot_hold(
    mode: str, stall_s: float
) -> None:
    one = running(mode)
    before = len(one.turns)
    one.port.pause(stall_s)
    kept = bytes(one.port._waiting)
    del one.port._waiting[4095:]
    one.run(1.0)
    overflowed = len(kept) > 4095
    # A decoder may fall out of step once more where it begins to listen again.
    assert overflowed <= one.lidar.counters.details["epochs"] <= 2 * overflowed
    assert len(one.turns) - before >= 10 * (min(stall_s, 0.35) + 1.0) - 4
    assert_true(one)


@ALL
@pytest.mark.parametrize("gap_s", [0.06, 0.1, 0.37])
def test_a_gap_in_the_middle_whose_bytes_are_lost(mode: str, gap_s: float) -> None:
    one = running(mode)
    before = len(one.turns)
    one.model.faults.silent = True
    one.run(gap_s, timeout_s=0.01)
    one.model.faults.silent = False
    one.run(1.0)
    # The angles tell how many capsules are missing, as long as it is less than a turn.
    if gap_s > 0.08:
        assert one.lidar.counters.details["epochs"] >= 1
    assert one.lidar.counters.details["epochs"] + one.lidar.counters.lost_samples > 0
    assert len(one.turns) - before >= 7
    assert_true(one)


def test_a_request_to_scan_that_gets_lost_is_asked_again() -> None:
    class Deaf(RPLidarModel):
        asked = 0

        def _scan(self, mode: ScanMode, now_ns: int, *, needs_rotation: bool) -> None:
            self.asked += 1
            if self.asked > 1:
                super()._scan(mode, now_ns, needs_rotation=needs_rotation)

    one = Bench(Deaf()).connected()
    assert one.lidar.counters.timeouts == 1
    one.run(3.0)
    assert one.turns


def test_behind_a_usb_adapter_the_earliest_ticks_are_still_true() -> None:
    one = running("Boost", usb_frame_ns=1_000_000)
    late = [t.arrival_ns - t.delay_ns - t.device_ns for t in one.ticks]
    true_ns = int(one.model.true_ns(np.array([0]))[0])
    assert -1000 <= min(late) - true_ns < 200_000
    assert max(late) - true_ns <= 1_001_000


def test_answers_cut_to_single_bytes_and_late_are_understood() -> None:
    class Slow(RPLidarModel):
        def _reply(self, kind: int, payload: bytes, now_ns: int) -> None:
            head = len(self._line.due(0))
            assert head == 0
            super()._reply(kind, payload, now_ns + 50_000_000)

    one = Bench(Slow(a2m8((1, 27)))).connected()
    assert one.lidar.identify()["scan_mode"] == "Boost"


def test_a_list_of_modes_that_does_not_come_is_replaced_by_what_all_have() -> None:
    class Mute(RPLidarModel):
        def _conf(self, payload: bytes) -> bytes:
            return b"" if payload[0] == 0x75 else super()._conf(payload)

    one = Bench(Mute()).connected()
    assert one.lidar.identify()["scan_mode"] == "Express"
    assert one.lidar.identify()["us_per_sample"] == 254.0
