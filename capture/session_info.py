"""`session.yaml`: what a session is, when and with what it was made, whether it is any good."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from capture.configuration import configuration_from_text
from capture.errors import ConfigurationError, SessionError, TextFileError
from capture.number_rows import read_text
from capture.yaml_file import read_yaml, write_yaml
from geometry import Stamps

FORMAT = 1
FILE_NAME = "session.yaml"


def software() -> str:
    """Name and version of this program, as files that it writes tell them."""
    from importlib.metadata import version

    return f"trackside {version('trackside')}"


@dataclass(frozen=True, kw_only=True)
class ClockPair:
    """The monotonic and the UTC clock of the recording machine, read at one moment."""

    monotonic_ns: int
    utc_ns: int


@dataclass(frozen=True, kw_only=True)
class PeerClock:
    """The clocks of another machine against ours, asked over the network at one moment.

    monotonic_ns, utc_ns : of ours, when the best answer came; offset_monotonic_ns, offset_utc_ns :
    the peer's clock minus ours then; uncertainty_ns : half of the best round trip and the scatter;
    boot_id, own_boot_id : of the peer and of us, as Linux names a run of a machine ("": unknown).
    """

    peer: str
    monotonic_ns: int
    utc_ns: int
    offset_monotonic_ns: int
    offset_utc_ns: int
    uncertainty_ns: int
    round_trip_ns: int
    answers: int
    boot_id: str = ""
    own_boot_id: str = ""
    method: str = "midpoint of the shortest round trip"


@dataclass(frozen=True, kw_only=True)
class FilmClock:
    """The overhead camera's clock on the session's: t = t_film + offset + skew (t_film - ref).

    ref_ns : on the film's clock; sigma_ns, sigma_skew : standard deviations, the former at ref_ns;
    network_offset_ns, network_sigma_ns : what the machines told each other for the same moment;
    film : what was joined: name, devices, verdict of the film.
    """

    offset_ns: int
    ref_ns: int
    skew: float = 0.0
    sigma_ns: int = 0
    sigma_skew: float = 0.0
    method: str = ""
    network_offset_ns: int | None = None
    network_sigma_ns: int | None = None
    film: Mapping[str, object] = field(default_factory=dict)

    def session_ns(self, film_ns: int) -> int:
        """The session's time of a time of the film."""
        # The product is small, so the float holds it to the nanosecond; the rest stays integer.
        return film_ns + self.offset_ns + round(self.skew * (film_ns - self.ref_ns))

    def all_session_ns(self, film_ns: Stamps) -> Stamps:
        """The same for many times, (n,)."""
        drift: Stamps = np.rint(self.skew * (film_ns - self.ref_ns)).astype(np.int64)
        mapped: Stamps = film_ns + self.offset_ns + drift
        return mapped


@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """The content of `session.yaml`.

    map, power, trial : what was driven, as the thesis' tables name it; start_utc : ISO 8601;
    clocks : pairs that map monotonic time to UTC; boot_id : of the machine, as Linux names it;
    peer_clocks : of other machines, asked while recording; chrony : what `chronyc -c tracking`
    said; film_clock : where a film was joined to it; devices : as they identified themselves;
    configuration : in force while recording; verdict : the operator's, with the reason;
    origin : for an imported session where it came from, and what was left out on the way.
    """

    format: int = FORMAT
    map: str = ""
    power: str = ""
    trial: int | None = None
    start_utc: str = ""
    clocks: tuple[ClockPair, ...] = ()
    boot_id: str = ""
    peer_clocks: tuple[PeerClock, ...] = ()
    chrony: tuple[str, ...] = ()
    film_clock: FilmClock | None = None
    devices: Mapping[str, object] = field(default_factory=dict)
    configuration: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)
    verdict: Literal["good", "bad"] | None = None
    verdict_reason: str = ""
    notes: str = ""
    origin: Mapping[str, object] = field(default_factory=dict)


def read_session_info(folder: Path) -> SessionInfo:
    """The `session.yaml` of a session.

    Raises `SessionError` when the folder is no session, cannot be read or has a newer format.
    """
    file = folder / FILE_NAME
    try:
        if not folder.exists():
            raise SessionError(f"{folder}: there is no such folder; check the path")
        if not file.exists():
            raise SessionError(_no_session(folder))
        number = read_yaml(file).get("format")
        if isinstance(number, int) and number > FORMAT:
            raise SessionError(
                f"{file}: has format {number}; this {software()} reads formats up to {FORMAT}; "
                "update trackside"
            )
        return configuration_from_text(SessionInfo, read_text(file), str(file))
    except OSError as err:
        why = err.strerror or str(err)
        raise SessionError(f"{folder}: cannot be read: {why}; check owner and mode") from err
    except (ConfigurationError, TextFileError) as err:
        raise SessionError(str(err)) from err


def write_session_info(folder: Path, info: SessionInfo) -> None:
    """Write `session.yaml`; raises `LogError` when the disk does not take it."""
    from capture.yaml_file import plain

    values = plain(info)
    assert isinstance(values, dict)
    write_yaml(folder / FILE_NAME, values)


def _no_session(folder: Path) -> str:
    inside = sorted(child.parent.name for child in folder.glob(f"*/{FILE_NAME}"))
    if inside:
        hint = f"it holds sessions: give one of them, such as {folder / inside[0]}"
    else:
        hint = "give a folder that trackside record or trackside import made"
    return f"{folder}: is no session (it has no {FILE_NAME}); {hint}"
