from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from full_rig import Emulated, record
from rig_audit import audited, missing_bytes

from capture.recording.check import checked
from capture.session import Session


@pytest.fixture
def emulated() -> Iterator[Emulated]:
    devices = Emulated.start()
    yield devices
    devices.stop()


@pytest.mark.slow
def test_half_a_minute_of_the_whole_rig_loses_nothing(tmp_path: Path, emulated: Emulated) -> None:
    """The figures of `benchmarks/recorder.py`, with room for other programs on this machine."""
    use = record(tmp_path, emulated, 30.0, camera=True)
    streams = {stream.name: stream for stream in audited(tmp_path, emulated)}
    assert {name: stream.missing for name, stream in streams.items()} == {
        "lidar": 0,
        "vesc": 0,
        "mpu9250": 0,
        "overhead": 0,
    }
    assert streams["lidar"].messages >= 295
    assert streams["overhead"].messages >= 890
    late = {name: np.percentile(np.abs(s.error_s), 90) < 2e-3 for name, s in streams.items()}
    assert late == dict.fromkeys(streams, True)
    assert use.core_share < 0.7
    assert use.memory_mb[1] < use.memory_mb[0] + 10.0
    assert use.verdict.verdict == "good", use.verdict.text
    assert checked(Session.open(tmp_path))[1] == use.verdict


def test_the_audit_finds_a_hole_and_forgives_what_came_after_the_end() -> None:
    sent = bytes(range(256)) * 40
    assert missing_bytes(sent, sent) == 0
    assert missing_bytes(sent[100:-1000], sent) == 0
    assert missing_bytes(sent[:3000] + sent[3001:], sent) == len(sent)
    assert missing_bytes(sent[:-5000], sent) == 5000
