"""Recordings as boards."""

from __future__ import annotations

from imu_readings import collect, samples_of
from razor_talk import device

from drivers import (
    Chunk,
    ModelPort,
)
from drivers.imu.razor import (
    RazorModel,
    ReplayModel,
    razor_model,
)


def test_a_recording_can_be_played_to_the_driver() -> None:
    imu, port = device(RazorModel())
    imu.connect()
    readings = collect(imu, port, 3.0)
    chunks = [chunk for reading in readings for chunk in reading.raw]
    again, port = device(razor_model(chunks))
    again.connect()
    replayed = samples_of(collect(again, port, 1.0))
    recorded = {s.device_ns: s.angular_velocity_rad_s for s in samples_of(readings)}
    assert len(replayed) > 95
    assert all(recorded[s.device_ns] == s.angular_velocity_rad_s for s in replayed)


def test_a_recording_keeps_its_pace_and_ends_or_begins_again() -> None:
    chunks = [Chunk(5_000_000_000, b"a"), Chunk(5_010_000_000, b"b"), Chunk(5_500_000_000, b"c")]
    port = ModelPort(ReplayModel(chunks), start_ns=10**9)
    times = []
    while (chunk := port.read(1.0)) is not None:
        times.append((chunk.t_ns // 1_000_000, chunk.data))
    assert times == [(1000, b"a"), (1010, b"b"), (1500, b"c")]
    port = ModelPort(ReplayModel(chunks, repeat=True), start_ns=10**9)
    data = b""
    for _ in range(7):
        chunk = port.read(1.0)
        assert chunk is not None
        data += chunk.data
    assert data == b"abcabca"


def test_nothing_recorded_is_silence() -> None:
    assert ModelPort(ReplayModel([])).read(1.0) is None
