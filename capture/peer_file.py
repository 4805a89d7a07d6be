"""What another machine's clock said, as a file: `trackside clock ask -o clock.yaml`."""

from __future__ import annotations

from pathlib import Path

from capture.configuration import read_configuration
from capture.session_info import PeerClock
from capture.yaml_file import plain, write_yaml


def write_peer_clock(file: Path, told: PeerClock) -> None:
    """Write it; raises `LogError` when the disk does not take it."""
    values = plain(told)
    assert isinstance(values, dict)
    write_yaml(file, values)


def read_peer_clock(file: Path) -> PeerClock:
    """The content of a file; raises `ConfigurationError` with every fault and its place."""
    return read_configuration(PeerClock, file)
