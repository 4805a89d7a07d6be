from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from toy_devices import UTC_0, S, ToyClocks, ToyDevice, toy_streams

from capture import PeerClock, Session, SessionInfo
from capture.chrony import chrony_words
from capture.configuration import configuration_from_text
from capture.errors import ConfigurationError
from capture.recording.clock_witness import ClockWitness
from capture.recording.recorder import Limits, Recorder
from capture.recording.rig import Rig
from capture.session_info import ClockPair

TENTHS = [k / 10 for k in range(1, 50)]


def answer(at_ns: int) -> PeerClock:
    return PeerClock(
        peer="laptop:47123",
        monotonic_ns=at_ns,
        utc_ns=UTC_0,
        offset_monotonic_ns=5,
        offset_utc_ns=6,
        uncertainty_ns=7,
        round_trip_ns=14,
        answers=9,
    )


def recorded(folder: Path, witness: ClockWitness) -> SessionInfo:
    """What `session.yaml` says after a short recording."""
    clocks = ToyClocks()
    folder.mkdir()
    info = SessionInfo(clocks=(ClockPair(monotonic_ns=100 * S, utc_ns=UTC_0),))
    streams = toy_streams(clocks, [ToyDevice("imu", TENTHS)])
    with Recorder(
        folder, info, streams, clocks.utc, Limits(), clocks.clocks(), witness
    ) as recorder:
        recorder.poll()
    return Session.open(folder).info


def test_the_recording_keeps_the_other_clocks_of_its_start_and_end(tmp_path: Path) -> None:
    asked: list[str] = []

    def ask(server: str, seconds: float, ended: Callable[[], bool]) -> PeerClock:
        assert seconds > 0.0
        assert not (ended() and not asked)
        asked.append(server)
        return answer(len(asked))

    info = recorded(tmp_path / "session", ClockWitness("laptop", ask, lambda: "A1B2,laptop,2"))
    assert asked == ["laptop", "laptop"]
    assert info.peer_clocks == (answer(1), answer(2))
    assert info.chrony == ("A1B2,laptop,2", "A1B2,laptop,2")


def test_a_server_that_is_not_there_is_a_fault_and_is_not_asked_again(tmp_path: Path) -> None:
    def ask(server: str, _: float, __: Callable[[], bool]) -> PeerClock:
        raise OSError(f"{server} is asleep")

    witness = ClockWitness("laptop", ask, lambda: "")
    info = recorded(tmp_path / "session", witness)
    assert witness.faults == ["laptop is asleep"]
    assert info.peer_clocks == ()


def test_an_answer_that_never_comes_is_left_behind() -> None:
    never = threading.Event()

    def ask(_: str, __: float, ___: Callable[[], bool]) -> PeerClock:
        never.wait(5.0)
        return answer(1)

    witness = ClockWitness("laptop", ask, lambda: "")
    witness.begin()
    assert witness.told(wait_s=0.01) == ((), ())
    never.set()
    assert witness.told(wait_s=5.0) == ((answer(1),), ())


def test_the_rig_names_the_server() -> None:
    rig = configuration_from_text(Rig, "recording: {clock_server: '10.0.0.2:5000'}", "rig.yaml")
    assert rig.recording.clock_server == "10.0.0.2:5000"
    with pytest.raises(ConfigurationError, match="no HOST or HOST:PORT"):
        configuration_from_text(Rig, "recording: {clock_server: 'laptop:x'}", "rig.yaml")


@pytest.mark.parametrize(
    ("script", "told"),
    [("echo 7F7F0101,local,10", "7F7F0101,local,10"), ("exit 1", ""), (None, "")],
)
def test_chronys_words_are_taken_where_there_are_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str | None, told: str
) -> None:
    if script is not None:
        program = tmp_path / "chronyc"
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin" if script else str(tmp_path))
    assert chrony_words() == told
