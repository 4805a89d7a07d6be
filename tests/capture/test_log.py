"""Writing and reading logs: `capture.log_writer` and `capture.log_reader`."""

from __future__ import annotations

import os
from contextlib import suppress
from itertools import count
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from small_session import odometry

from capture import LogError
from capture.log_columns import odometry_columns
from capture.log_reader import McapLog
from capture.log_writer import LogWriter
from capture.messages import odometry_messages
from capture.topics import ODOMETRY_TYPE


def fill(log: LogWriter, n: int) -> list[bytes]:
    """Write n messages at 50 Hz on two topics; gives the messages."""
    made = odometry(n=n)
    messages = odometry_messages(made)
    for t_ns, message in zip(made.t_ns.tolist(), messages, strict=True):
        log.write("/a/odom", ODOMETRY_TYPE, message, log_t_ns=t_ns + 5, stamp_ns=t_ns)
        log.write("/b/odom", ODOMETRY_TYPE, message, log_t_ns=t_ns + 3, stamp_ns=t_ns)
    return messages


def whole_log(file: Path, n: int = 50) -> list[bytes]:
    with LogWriter(file) as log:
        return fill(log, n)


def cut_off_log(file: Path, n: int = 500) -> None:
    """What a power cut leaves of n messages at 50 Hz: the file as it is before its end comes."""
    ticks = count(0, 10)  # milliseconds: the clock is read once for each of the two topics
    with LogWriter(file.with_name("running"), clock_s=lambda: next(ticks) * 1e-3) as log:
        fill(log, n)
        file.write_bytes((file.parent / "running").read_bytes())


def foreign_log(file: Path, encoding: str, schema: str) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        number = writer.register_schema("a/msg/B", schema, b"{}")
        channel = writer.register_channel("/settings", encoding, number)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped


def test_what_is_written_is_read(tmp_path: Path) -> None:
    messages = whole_log(tmp_path / "car.mcap")
    log = McapLog(tmp_path / "car.mcap")
    assert (log.truncated, log.remarks) == (False, ())
    assert {name: topic.count for name, topic in log.topics.items()} == {
        "/a/odom": 50,
        "/b/odom": 50,
    }
    assert log.topics["/a/odom"].rate_hz == pytest.approx(50.0)
    raw = log.read("/a/odom")
    assert raw.messages == messages
    np.testing.assert_array_equal(raw.log_t_ns, odometry().t_ns + 5)
    assert log.read("/c").messages == []


def test_rosbags_reads_the_same(tmp_path: Path) -> None:
    messages = whole_log(tmp_path / "car.mcap")
    with AnyReader([tmp_path / "car.mcap"]) as reader:
        found = [(c.topic, t, bytes(data)) for c, t, data in reader.messages()]
    times = odometry().t_ns.tolist()
    assert [row for row in found if row[0] == "/a/odom"] == [
        ("/a/odom", t + 5, message) for t, message in zip(times, messages, strict=True)
    ]


def test_a_log_without_its_end_loses_at_most_the_last_second(tmp_path: Path) -> None:
    cut_off_log(tmp_path / "cut.mcap", n=520)
    log = McapLog(tmp_path / "cut.mcap")
    assert log.truncated
    assert 470 <= len(log.read("/a/odom").messages) <= 520
    assert log.damaged_chunks == 0
    assert log.remarks == (
        "cut.mcap has no end (power loss or kill): read up to its last whole chunk",
    )


def test_wherever_a_log_ends_it_is_read_up_to_there(tmp_path: Path) -> None:
    cut_off_log(tmp_path / "cut.mcap")
    content = (tmp_path / "cut.mcap").read_bytes()
    counts = []
    for length in range(len(content), len(content) // 5, -997):
        (tmp_path / "cut.mcap").write_bytes(content[:length])
        log = McapLog(tmp_path / "cut.mcap")
        counts.append(log.topics["/a/odom"].count)
        assert log.damaged_chunks == 0
    assert counts == sorted(counts, reverse=True)
    assert counts[0] >= 450
    assert 50 <= counts[-1] <= 150


def test_a_tail_of_zeros_ends_the_log(tmp_path: Path) -> None:
    cut_off_log(tmp_path / "cut.mcap")
    with (tmp_path / "cut.mcap").open("ab") as stream:
        stream.write(bytes(4096))
    assert len(McapLog(tmp_path / "cut.mcap").read("/a/odom").messages) >= 450


def test_a_damaged_chunk_is_left_out_and_told(tmp_path: Path) -> None:
    cut_off_log(tmp_path / "car.mcap")
    content = bytearray((tmp_path / "car.mcap").read_bytes())
    at = content.index(b"zstd", len(content) // 2) + 200
    content[at : at + 50] = bytes(50)
    (tmp_path / "car.mcap").write_bytes(content)
    log = McapLog(tmp_path / "car.mcap")
    assert 350 <= len(log.read("/a/odom").messages) <= 450
    assert any("1 damaged chunks failed their checksum" in remark for remark in log.remarks)


def test_damage_that_loses_the_rest_is_told(tmp_path: Path) -> None:
    cut_off_log(tmp_path / "cut.mcap")
    content = bytearray((tmp_path / "running").read_bytes())
    at = content.index(b"zstd", len(content) // 2)
    content[at - 30 : at] = b"\xff" * 30
    (tmp_path / "car.mcap").write_bytes(content)
    log = McapLog(tmp_path / "car.mcap")
    assert not log.truncated
    assert 0 < log.topics["/a/odom"].count < 500
    assert log.remarks == ("car.mcap is damaged: what follows the damage is lost",)


def test_a_log_that_stopped_before_its_first_chunk_is_refused(tmp_path: Path) -> None:
    whole_log(tmp_path / "car.mcap")
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "car.mcap").read_bytes()[:60])
    log = McapLog(tmp_path / "cut.mcap")
    with pytest.raises(LogError, match=r"cut\.mcap: holds no readable message and has no end"):
        _ = log.topics


@pytest.mark.parametrize(("content", "what"), [(b"", "is empty"), (b"not a log", "no MCAP file")])
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes, what: str) -> None:
    (tmp_path / "car.mcap").write_bytes(content)
    with pytest.raises(LogError, match=rf"car\.mcap: is .*{what[-5:]}; expected .*; restore"):
        McapLog(tmp_path / "car.mcap")


@pytest.mark.parametrize(("encoding", "schema"), [("json", "jsonschema"), ("cdr", "jsonschema")])
def test_a_channel_of_another_encoding_is_named(tmp_path: Path, encoding: str, schema: str) -> None:
    foreign_log(tmp_path / "car.mcap", encoding, schema)
    with pytest.raises(LogError, match=rf"channel /settings is encoded as {encoding}.*jsonschema"):
        _ = McapLog(tmp_path / "car.mcap").topics


def test_an_unreadable_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    whole_log(tmp_path / "car.mcap")
    monkeypatch.setattr(Path, "open", deny)
    with pytest.raises(LogError, match=r"car\.mcap: cannot be read: Permission denied; check"):
        McapLog(tmp_path / "car.mcap")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_told_with_file_and_room() -> None:
    with pytest.raises(
        LogError, match=r"cannot write /dev/full: No space left.*MB free.*make room"
    ):
        whole_log(Path("/dev/full"))


def test_a_log_is_forced_to_disk_once_a_period(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forced: list[int] = []
    monkeypatch.setattr(os, "fdatasync", forced.append)
    cut_off_log(tmp_path / "cut.mcap", n=500)
    # 1000 messages, 10 ms apart on the clock of the test: ten seconds.
    assert len(forced) in (9, 10)


def test_after_an_error_the_log_has_no_end(tmp_path: Path) -> None:
    log = LogWriter(tmp_path / "car.mcap").__enter__()
    fill(log, 50)
    log.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert McapLog(tmp_path / "car.mcap").truncated


def test_a_log_without_chunks_is_read(tmp_path: Path) -> None:
    (message,) = odometry_messages(odometry(n=1))
    with (tmp_path / "car.mcap").open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(ODOMETRY_TYPE, "ros2msg", b"float64 x")
        channel = writer.register_channel("/a/odom", "cdr", schema)
        for log_t_ns in (30, 10, 20):
            writer.add_message(channel, log_t_ns, message, 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped
    log = McapLog(tmp_path / "car.mcap")
    assert log.topics["/a/odom"].count == 3
    assert log.read("/a/odom").log_t_ns.tolist() == [10, 20, 30]


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.floats(0, 1), junk=st.binary(min_size=1, max_size=40), crc=st.booleans())
def test_damage_anywhere_is_survived_or_told(
    tmp_path: Path, at: float, junk: bytes, crc: bool
) -> None:
    messages = odometry_messages(odometry(n=4))
    with (tmp_path / "car.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, compression=CompressionType.NONE, enable_crcs=crc)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(ODOMETRY_TYPE, "ros2msg", b"float64 x")
        channel = writer.register_channel("/a/odom", "cdr", schema)
        for log_t_ns, message in enumerate(messages):
            writer.add_message(channel, log_t_ns, message, 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped
    content = bytearray((tmp_path / "car.mcap").read_bytes())
    start = int(at * (len(content) - 1))
    content[start : start + len(junk)] = junk
    (tmp_path / "car.mcap").write_bytes(content)
    with suppress(LogError):
        log = McapLog(tmp_path / "car.mcap")
        found = [log.read(topic).messages for topic in log.topics]
        assert sum(map(len, found)) <= len(messages) + 1


def test_a_log_needs_its_folder(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"cannot write .*absent.car\.mcap: No such file"):
        LogWriter(tmp_path / "absent" / "car.mcap").__enter__()


def test_a_quarter_of_an_hour_of_odometry_is_read_in_a_moment(tmp_path: Path) -> None:
    made = odometry(n=20_000)
    with LogWriter(tmp_path / "car.mcap") as log:
        for t_ns, message in zip(made.t_ns.tolist(), odometry_messages(made), strict=True):
            log.write("/a/odom", ODOMETRY_TYPE, message, log_t_ns=t_ns, stamp_ns=t_ns)
    spent_s = []
    for _ in range(3):
        start_s = process_time()
        found = odometry_columns(McapLog(tmp_path / "car.mcap").read("/a/odom"), "a")
        spent_s.append(process_time() - start_s)
    np.testing.assert_array_equal(found.pose_odom_base, made.pose_odom_base)
    # 0.07 s on the reference machine; the factor leaves room for slower ones.
    assert min(spent_s) < 0.35
