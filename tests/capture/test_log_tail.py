"""A log that grows under the reader's eyes: `capture.log_tail`."""

from __future__ import annotations

import random
from itertools import count
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from small_session import START_NS, observations, odometry

from capture import LogError, LogTail, point_cloud_message
from capture.log_reader import McapLog
from capture.log_writer import LogWriter
from capture.messages import observation_messages, odometry_messages
from capture.topics import ODOMETRY_TYPE, POINTS_TYPE, RANGE_BEARING_TOPIC, RANGE_BEARING_TYPE


def log_of_many_chunks(file: Path, n: int = 300) -> bytes:
    """Two topics, a chunk every half second."""
    made = odometry(n=n)
    ticks = count(0, 10)
    with LogWriter(file, sync_period_s=0.5, clock_s=lambda: next(ticks) * 1e-3) as log:
        for t_ns, data in zip(made.t_ns.tolist(), odometry_messages(made), strict=True):
            log.write("/a/odom", ODOMETRY_TYPE, data, log_t_ns=t_ns + 5, stamp_ns=t_ns)
            log.write("/b/odom", ODOMETRY_TYPE, data, log_t_ns=t_ns + 3, stamp_ns=t_ns)
    return file.read_bytes()


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return log_of_many_chunks(tmp_path_factory.mktemp("log") / "car.mcap")


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_however_the_file_grows_each_message_comes_once(
    tmp_path: Path, content: bytes, seed: int
) -> None:
    file = tmp_path / f"{seed}.mcap"
    tail, draw, size = LogTail(file), random.Random(seed), 0
    found: dict[str, list[bytes]] = {}
    assert not tail.read()
    while not tail.ended:
        size = min(len(content), size + draw.choice([1, 8, 9, 200, 5000, 20_000]))
        file.write_bytes(content[:size])
        before = tail.done_bytes
        for topic, raw in tail.read().raw.items():
            found.setdefault(topic, []).extend(raw.messages)
            assert raw.log_t_ns.tolist() == sorted(raw.log_t_ns.tolist())
        assert before <= tail.done_bytes <= size
    assert not tail.read()
    whole = McapLog(file) if size == len(content) else None
    expected = odometry_messages(odometry(n=300))
    assert found == {"/a/odom": expected, "/b/odom": expected}
    assert whole is None or whole.read("/a/odom").messages == expected


def test_what_was_read_is_not_read_again(tmp_path: Path, content: bytes) -> None:
    """The part that was read may even be gone."""
    file = tmp_path / "car.mcap"
    file.write_bytes(content[: len(content) // 2])
    tail = LogTail(file)
    first = tail.read().raw["/a/odom"]
    file.write_bytes(b"x" * tail.done_bytes + content[tail.done_bytes :])
    rest = tail.read().raw["/a/odom"]
    assert [*first.messages, *rest.messages] == odometry_messages(odometry(n=300))


def test_a_large_backlog_comes_in_parts(
    tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("capture.log_tail._MOST_BYTES", 1)
    file = tmp_path / "car.mcap"
    file.write_bytes(content)
    tail = LogTail(file)
    parts = [tail.read() for _ in range(100)]
    assert tail.ended
    assert sum(bool(part) for part in parts) > 3
    found = [data for part in parts if part for data in part.raw["/a/odom"].messages]
    assert found == odometry_messages(odometry(n=300))


def test_a_damaged_chunk_is_passed_over(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "car.mcap"
    broken = bytearray(content)
    # In the middle of the second chunk's compressed data; the first tells of the channels.
    at = content.index(b"zstd", content.index(b"zstd") + 1) + 200
    broken[at] ^= 0xFF
    file.write_bytes(bytes(broken))
    found = LogTail(file).read().raw["/b/odom"].messages
    expected = odometry_messages(odometry(n=300))
    assert 200 < len(found) < 300
    assert found == [data for data in expected if data in found]


def test_room_without_content_is_waited_for(tmp_path: Path, content: bytes) -> None:
    """Some file systems show the new size before the new content."""
    file = tmp_path / "car.mcap"
    half = len(content) // 2
    file.write_bytes(content[:half])
    tail = LogTail(file)
    first = tail.read().raw["/a/odom"].messages
    file.write_bytes(content[: tail.done_bytes] + bytes(10_000))
    assert not tail.read()
    file.write_bytes(content)
    assert [*first, *tail.read().raw["/a/odom"].messages] == odometry_messages(odometry(n=300))


def test_another_file_in_its_place_is_told(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "car.mcap"
    file.write_bytes(content)
    tail = LogTail(file)
    tail.read()
    file.write_bytes(content[:100])
    with pytest.raises(LogError, match="became shorter while it was followed"):
        tail.read()


def test_what_is_no_log_is_told(tmp_path: Path) -> None:
    file = tmp_path / "car.mcap"
    file.write_bytes(b"PK")
    with pytest.raises(LogError, match="no MCAP file"):
        LogTail(file).read()
    with pytest.raises(LogError, match="cannot be read"):
        LogTail(tmp_path).read()


def test_a_channel_that_is_not_cdr_is_told(tmp_path: Path) -> None:
    with (tmp_path / "car.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        channel = writer.register_channel(
            "/settings", "json", writer.register_schema("a", "jsonschema", b"{}")
        )
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped
    with pytest.raises(LogError, match="encoded as json"):
        LogTail(tmp_path / "car.mcap").read()


def test_messages_without_chunks_are_read_too(tmp_path: Path) -> None:
    file, messages = tmp_path / "car.mcap", odometry_messages(odometry(n=3))
    with file.open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(ODOMETRY_TYPE, "ros2msg", b"x")
        channel = writer.register_channel("/a/odom", "cdr", schema)
        for k, data in enumerate(messages):
            writer.add_message(channel, START_NS + k, data, START_NS)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped
    assert LogTail(file).read().raw["/a/odom"].messages == messages


def test_what_arrived_is_decoded_by_stream(tmp_path: Path) -> None:
    made, seen = odometry(n=3), observations()
    _, sightings = observation_messages(seen)
    cloud = point_cloud_message(
        START_NS, made.t_ns, made.speed_m_s, made.yaw_rate_rad_s, made.speed_m_s
    )
    with LogWriter(tmp_path / "car.mcap") as log:
        for k, data in enumerate(odometry_messages(made)):
            log.write("/wheel/odom", ODOMETRY_TYPE, data, log_t_ns=k + 10, stamp_ns=0)
        log.write("/lidar/points", POINTS_TYPE, cloud, log_t_ns=20, stamp_ns=0)
        for data in sightings:
            log.write(RANGE_BEARING_TOPIC, RANGE_BEARING_TYPE, data, log_t_ns=9, stamp_ns=0)
    new = LogTail(tmp_path / "car.mcap").read()
    assert (new.first_log_t_ns, new.log_t_ns, new.odometry_sources) == (9, 20, ("wheel",))
    found = new.odometry("wheel")
    assert found is not None
    assert found.t_ns.tolist() == made.t_ns.tolist()
    assert [(t, scan.range_m.tolist()) for t, scan in new.points()] == [(20, [1.5] * 3)]
    assert [part.landmark_id.tolist() for _, part in new.observations()] == [
        [3, 5, -1],
        [3],
        [3, 5],
    ]
    assert (new.imu(), new.vesc_state(), new.drive(), new.scans()) == (None, None, None, [])
