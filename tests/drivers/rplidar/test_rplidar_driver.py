from __future__ import annotations

import threading
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
import pytest
from lidar_bench import Bench, on_our_clock
from lidar_streams import ultra

from dialogue import UsageError
from drivers import Chunk, DeviceLostError, ModelPort, Port
from drivers.rplidar import (
    LidarPort,
    LidarSpec,
    RPLidar,
    RPLidarConfig,
    RPLidarModel,
    a2m8,
    replay,
    room,
)
from drivers.rplidar.emulator import BOOST, DENSE, STANDARD
from drivers.rplidar.protocol import Command, Info, pwm_request, request

STOP = request(Command.STOP)
MODES = ["Standard", "Express", "Boost", "Sensitivity", "Stability", "DenseBoost"]


def bench(mode: str | None = None, *, spec: LidarSpec | None = None, **rest: object) -> Bench:
    spec = spec or a2m8()
    if mode == DENSE.name:
        spec = replace(spec, modes=(STANDARD, DENSE), baud=256000)
    model = RPLidarModel(spec, ppm=cast(float, rest.pop("ppm", 0.0)))
    return Bench(model, RPLidarConfig("/dev/lidar", scan_mode=mode, **rest))  # type: ignore[arg-type]  # named by each test


def test_making_one_touches_nothing() -> None:
    def open_port(path: str, baud: int) -> LidarPort:
        raise AssertionError(f"{path} was opened at {baud}")

    lidar = RPLidar(RPLidarConfig("/dev/lidar"), open_port)
    assert lidar.name == "RPLidar on /dev/lidar"
    assert lidar.identify() == {"port": "/dev/lidar"}
    lidar.close()
    with pytest.raises(DeviceLostError, match="not connected"):
        lidar.read(0.1)


def test_it_says_who_it_is() -> None:
    assert bench().connected().lidar.identify() == {
        "port": "/dev/lidar",
        "model": "A2M8",
        "firmware": "1.29",
        "hardware": 5,
        "serial": "ABB69AF2C1EA9FC2A2EB92F138653C00",
        "health": "good",
        "scan_mode": "Sensitivity",
        "scan_mode_note": "",
        "answer_type": "0x84",
        "us_per_sample": 127.0,
        "max_distance_m": 12.0,
        "baud": 115200,
        "motor": "PWM by the accessory board",
        "motor_pwm": 600,
        "rotation_hz": 10.0,
    }


@pytest.mark.parametrize("mode", MODES)
def test_turns_show_the_room_and_their_times_are_true(mode: str) -> None:
    one = bench(mode).connected()
    one.run(4.0)
    assert one.lidar.identify()["scan_mode"] == mode
    assert len(one.turns) >= 18
    period_ns = one.lidar.identify()["us_per_sample"] * 1000.0  # type: ignore[operator]
    shape = room()
    for turn in one.turns:
        index = np.rint(turn.device_ns / period_ns).astype(np.int64)
        late_ns = on_our_clock(one.ticks, turn) - one.model.true_ns(index)
        assert np.abs(late_ns).max() < 1000.0
        missing = np.isnan(turn.range_m)
        assert missing.mean() < 0.01
        # The scale of ultra capsules has steps of 4 mm there, and a wall 1/64 degree of slope.
        off_m = np.abs(turn.range_m - shape(turn.device_ns, turn.bearing_rad))[~missing]
        assert off_m.max() < 0.010
    assert one.lidar.counters.bad_frames == one.lidar.counters.lost_samples == 0
    assert one.lidar.counters.details["revolutions"] == len(one.turns)


def test_bearings_fall_since_the_lidar_turns_clockwise() -> None:
    one = bench("Standard").connected()
    one.run(3.5)
    steps = np.diff(np.unwrap(one.turns[-1].bearing_rad))
    assert np.median(steps) == pytest.approx(-2 * np.pi * 10 * 508e-6, rel=0.03)


@pytest.mark.parametrize("mode", ["Standard", "Boost"])
def test_a_crystal_that_is_off_shows_in_the_ticks(mode: str) -> None:
    one = bench(mode, ppm=200.0).connected()
    one.run(6.0)
    first, last = one.ticks[0], one.ticks[-1]
    slope = (last.arrival_ns - first.arrival_ns) / (last.device_ns - first.device_ns)
    assert slope - 1.0 == pytest.approx(200e-6, abs=2e-6)


def test_delays_are_those_of_the_data_sheet() -> None:
    # reference/protocols.md A.11: 1.2 ms, 7.7 ms and 11.6 ms at 115 200 baud.
    for mode, delay_ms in (("Standard", 1.196), ("Express", 7.673), ("Boost", 11.649)):
        one = bench(mode).connected()
        one.run(3.0)
        assert {tick.delay_ns for tick in one.ticks} == {one.ticks[0].delay_ns}
        assert one.ticks[0].delay_ns == pytest.approx(delay_ms * 1e6, abs=1000)


def test_a_tick_is_dated_back_by_the_bytes_behind_its_packet() -> None:
    data = b"".join(ultra(20))
    cuts = [0, 132, 300, 600, 1000, 132 * 11 + 131, len(data)]
    chunks = [Chunk(50_000_000 * i, data[a:b]) for i, (a, b) in enumerate(pairwise(cuts))]
    spec = replace(a2m8(), modes=(BOOST,))
    one = Bench(RPLidarModel(spec, replay=replay(chunks))).connected()
    for _ in chunks:
        reading = one.lidar.read(0.2)
        assert reading is not None
        (tick,), (chunk,) = reading.ticks, reading.raw
        end = cuts[1 + [len(c.data) for c in chunks].index(len(chunk.data))]
        behind_ns = end % 132 * 10_000_000_000 / 115200
        assert chunk.t_ns - tick.arrival_ns == pytest.approx(behind_ns, abs=1.0)
        assert tick.device_ns == (end // 132 * 96 - 1) * 127_000


def test_raw_is_every_byte_of_the_scan() -> None:
    one = bench("Boost").connected()
    one.run(4.0)
    assert len(one.raw) % 132 == 0
    assert one.lidar.counters.samples == 96 * (len(one.raw) // 132 - 1)


@pytest.mark.parametrize(
    ("firmware", "wish", "got", "note"),
    [
        ((1, 29), "boost", "Boost", ""),
        ((1, 29), "Fastest", "Sensitivity", "Fastest is not offered"),
        ((1, 27), None, "Boost", "Sensitivity is not offered (Standard, Express, Boost): Boost"),
        ((1, 27), "Stability", "Boost", "Stability is not offered"),
        ((1, 23), None, "Express", "Sensitivity is not offered (Standard, Express): Express"),
        ((1, 10), None, "Standard", "Sensitivity is not offered (Standard): Standard instead"),
    ],
)
def test_a_mode_that_is_not_there_falls_back_and_it_is_said(
    firmware: tuple[int, int], wish: str | None, got: str, note: str
) -> None:
    one = bench(wish, spec=a2m8(firmware)).connected()
    known = one.lidar.identify()
    assert known["scan_mode"] == got
    assert str(known["scan_mode_note"]).startswith(note)
    one.run(3.5)
    assert len(one.turns) > 5
    expected = {"Sensitivity": 127.0, "Boost": 127.0, "Express": 254.0, "Standard": 508.0}[got]
    assert known["us_per_sample"] == (expected if firmware >= (1, 17) else 476.0)


@pytest.mark.parametrize("pwm_per_hz", [50.0, 72.0])
@pytest.mark.parametrize("rotation_hz", [7.0, 12.0])
def test_the_rotation_is_held_by_the_measured_turns(pwm_per_hz: float, rotation_hz: float) -> None:
    spec = replace(a2m8(), pwm_per_hz=pwm_per_hz)
    one = bench("Express", spec=spec, rotation_hz=rotation_hz).connected()
    one.run(20.0)
    last = [1.0 / turn.period_s for turn in one.turns[-20:]]
    assert np.mean(last) == pytest.approx(rotation_hz, rel=0.015)
    assert one.lidar.counters.lost_samples == 0
    assert one.lidar.counters.details == {
        "revolutions": len(one.turns),
        "torn_revolutions": 0,
        "epochs": 0,
    }


def test_a_fixed_pwm_stays() -> None:
    one = bench("Express", motor_pwm=480).connected()
    one.run(10.0)
    assert one.turns[-1].period_s == pytest.approx(1.0 / 8.0, rel=0.01)
    assert one.lidar.identify()["motor_pwm"] == 480
    assert bytes(one.port.written).count(pwm_request(480)) == 1


def test_a_motor_on_the_dtr_line() -> None:
    spec = replace(a2m8(), info=Info(0x18, (1, 29), 7, "00" * 16), accessory_board=False)
    one = bench("Boost", spec=spec).connected()
    assert one.lidar.identify()["motor"] == "DTR line"
    moved = [one.port.dtr]
    one.run(4.0)
    assert len(one.turns) > 5
    one.lidar.close()
    assert [*moved, one.port.dtr] == [False, True]
    assert one.model.rotor.target_hz == 0.0


def test_an_a2_without_an_accessory_board_is_driven_by_dtr() -> None:
    one = bench(spec=replace(a2m8(), accessory_board=False)).connected()
    assert one.lidar.identify()["motor"] == "DTR line"


def test_a_motor_that_takes_a_speed() -> None:
    info = Info(0x61, (1, 29), 1, "00" * 16)
    spec = replace(a2m8(), info=info, accessory_board=False, baud=1_000_000)
    one = bench("Boost", spec=spec, rotation_hz=8.0).connected()
    known = one.lidar.identify()
    assert (known["motor"], known["motor_pwm"], known["baud"]) == ("speed command", None, 1_000_000)
    one.run(4.0)
    assert one.turns[-1].period_s == pytest.approx(1.0 / 8.0, rel=0.01)
    one.lidar.close()
    assert one.model.rotor.target_hz == 0.0


@pytest.mark.parametrize("baud", [115200, 256000, 460800, 1000000])
def test_the_speed_of_the_line_is_found(baud: int) -> None:
    one = bench(spec=replace(a2m8(), baud=baud)).connected()
    assert one.lidar.identify()["baud"] == baud
    one.run(3.0)
    assert one.turns


def test_closing_stops_scan_and_motor_and_gives_the_line_time() -> None:
    one = bench().connected()
    one.run(3.0)
    one.port.written.clear()
    before_ns = one.port.now_ns()
    one.lidar.close()
    assert bytes(one.port.written) == STOP + pwm_request(0)
    assert one.port.now_ns() - before_ns >= 10_000_000
    assert one.port.closed
    assert (one.model.state, one.model.rotor.target_hz) == ("idle", 0.0)
    one.lidar.close()
    with pytest.raises(DeviceLostError, match="not connected"):
        one.lidar.read(0.1)


def test_after_closing_it_connects_again_with_a_new_epoch() -> None:
    one = bench().connected()
    one.run(3.0)
    one.lidar.close()
    one.lidar.connect()
    turns = len(one.turns)
    one.run(3.0)
    assert {turn.epoch for turn in one.turns[:turns]} == {0}
    assert {turn.epoch for turn in one.turns[turns:]} == {1}
    assert {tick.epoch for tick in one.ticks} == {0, 1}


def test_closed_from_another_thread_while_it_connects() -> None:
    """Whatever moment close() comes at, nothing spins or scans after both have ended."""
    for reads in range(1, 25):
        one = bench()
        closer = ClosingPort(one, reads)
        lidar = RPLidar(one.config, lambda _path, _baud, port=closer: port)  # type: ignore[misc]
        closer.lidar = lidar
        try:
            lidar.connect()
        except DeviceLostError:
            assert lidar.identify() == {"port": "/dev/lidar"}
        else:
            lidar.close()
        assert (one.model.state, one.model.rotor.target_hz) == ("idle", 0.0)
        assert closer.closed


class ClosingPort(LidarPort):
    """Closes its driver from another thread before the nth read or write."""

    def __init__(self, bench: Bench, calls: int) -> None:
        super().__init__(bench.model)
        self.lidar: RPLidar | None = None
        self._left = calls

    def _check(self) -> None:
        self._left -= 1
        # A lock held by connect() keeps close() waiting, as it must; then the next call is it.
        if self._left <= 0 and self.lidar is not None and not self.lidar._lock.locked():
            lidar, self.lidar = self.lidar, None
            thread = threading.Thread(target=lidar.close)
            thread.start()
            thread.join()
        super()._check()


def test_a_port_of_a_model_is_a_port() -> None:
    port: Port = LidarPort(RPLidarModel())
    assert isinstance(port, ModelPort)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"rotation_hz": 0.0}, "rotation_hz"),
        ({"rotation_hz": 50.0}, "rotation_hz"),
        ({"motor_pwm": 0}, "motor_pwm"),
        ({"motor_pwm": 1024}, "motor_pwm"),
    ],
)
def test_settings_that_cannot_be_are_refused(change: dict[str, float], text: str) -> None:
    with pytest.raises(UsageError, match=text):
        RPLidarConfig("/dev/lidar", **change)  # type: ignore[arg-type]  # one of each kind
