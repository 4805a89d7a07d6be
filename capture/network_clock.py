"""The clock of another machine over the network: questions, answers, the shortest round trip.

One datagram each way (all big-endian, 72 bytes): magic `TSCK`, version, kind (1 question, 2
answer), two bytes 0, sequence (8 bytes, drawn at random at the start), the asker's monotonic time;
an answer adds four times of the server: monotonic when the question came and when the answer went,
monotonic and UTC at one moment; and its boot id (16 bytes). Offset and its bound by the midpoint of
the shortest round trip (NTP: Mills, RFC 5905, section 8; the bound: Cristian 1989).
"""

from __future__ import annotations

import secrets
import socket
import struct
import time
import uuid
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from capture.clock import read_clock_pair
from capture.errors import CaptureError
from capture.session_info import PeerClock

PORT = 47123
WAIT_S = 0.25
"""So long an answer may take: a slower one would tell nothing."""
POLL_S = 0.2
PAUSE_S = 0.02
LEAST_ANSWERS = 5
BEST_SHARE = 0.1
MOST_ROUND_TRIP_NS = 100_000_000
_MAGIC, _VERSION, _QUESTION, _ANSWER = b"TSCK", 1, 1, 2
_PACKET = struct.Struct(">4sBB2xQqqqqq16s")
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class NetworkClockError(CaptureError):
    """A clock that cannot be served or asked: no such host, no answer, too slow a network."""


@dataclass(frozen=True)
class MachineClocks:
    """The clocks of a machine and who it is, to be replaced in tests."""

    monotonic_ns: Callable[[], int] = time.monotonic_ns
    utc_ns: Callable[[], int] = time.time_ns
    pause: Callable[[float], None] = time.sleep
    boot_id: str | None = None

    @property
    def name(self) -> str:
        """The boot id of the machine."""
        return read_boot_id() if self.boot_id is None else self.boot_id


@dataclass(frozen=True)
class _Packet:
    kind: int
    sequence: int
    asked_ns: int
    came_ns: int = 0
    went_ns: int = 0
    monotonic_ns: int = 0
    utc_ns: int = 0
    boot_id: str = ""


@dataclass(frozen=True)
class _RoundTrip:
    """One answer: length of the way, our middle of it, the peer's clocks minus ours then."""

    length_ns: int
    middle_ns: int
    offset_monotonic_ns: int
    offset_utc_ns: int
    boot_id: str


def read_boot_id() -> str:
    """How Linux names this run of this machine: its monotonic clock began with it; "" elsewhere."""
    try:
        return _BOOT_ID.read_text(encoding="ascii").strip()
    except OSError:
        return ""


def host_and_port(text: str) -> tuple[str, int]:
    """`HOST[:PORT]`; raises `ValueError` for anything else."""
    host, colon, port = text.rpartition(":")
    if not colon:
        return text, PORT
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ValueError(f"{text!r} is no HOST or HOST:PORT")
    return host, int(port)


def opened_server(port: int = PORT, host: str = "") -> socket.socket:
    """A socket that hears the questions; raises `NetworkClockError` where the port is taken."""
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        server.bind((host, port))
    except OSError as err:
        server.close()
        raise NetworkClockError(
            f"UDP port {port} cannot be had: {err.strerror or err}; is trackside clock serve "
            "running already? Choose another with --port"
        ) from err
    return server


def serve(
    server: socket.socket,
    ended: Callable[[], bool],
    clocks: MachineClocks = MachineClocks(),
    heard: Callable[[str], None] = lambda _: None,
) -> int:
    """Answer every question until `ended`; how many there were. Foreign datagrams are left alone.

    heard : told the address of each that asked.
    """
    server.settimeout(POLL_S)
    answered, name = 0, clocks.name
    while not ended():
        try:
            data, address = server.recvfrom(2048)
        except (TimeoutError, ConnectionError):
            continue
        came_ns = clocks.monotonic_ns()
        question = _parsed(data, _QUESTION)
        if question is None:
            continue
        pair = read_clock_pair(clocks.monotonic_ns, clocks.utc_ns, tries=2)
        answer = _packed(
            _Packet(
                _ANSWER, question.sequence, question.asked_ns, came_ns, clocks.monotonic_ns(),
                pair.monotonic_ns, pair.utc_ns, name,
            )
        )  # fmt: skip
        try:
            server.sendto(answer, address)
        except OSError:
            continue  # who asked has gone
        answered += 1
        heard(str(address[0]))
    return answered


def ask(
    peer: str,
    seconds: float = 2.0,
    clocks: MachineClocks = MachineClocks(),
    ended: Callable[[], bool] = lambda: False,
) -> PeerClock:
    """The clocks of `HOST[:PORT]` against ours, of all round trips within these seconds.

    Raises `NetworkClockError` when too few answers come, or all too late to be of use.
    """
    host, port = host_and_port(peer)
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, 0, socket.SOCK_DGRAM)[0]
    except OSError as err:
        raise NetworkClockError(
            f"{host}: no such machine ({err.strerror or err}); give its name or its address"
        ) from err
    trips: list[_RoundTrip] = []
    begun_ns, sequence = clocks.monotonic_ns(), secrets.randbits(48)
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as line:
        while (clocks.monotonic_ns() - begun_ns) * 1e-9 < seconds and not ended():
            sequence += 1
            trip = _round_trip(line, address, sequence, clocks)
            if trip is not None:
                trips.append(trip)
            clocks.pause(PAUSE_S)
    if len(trips) < LEAST_ANSWERS:
        raise NetworkClockError(
            f"{host}:{port}: {len(trips)} answers in {seconds:g} s, at least {LEAST_ANSWERS} are "
            "needed; does trackside clock serve run there, is UDP let through?"
        )
    return _peer_clock(f"{host}:{port}", trips, clocks)


def _round_trip(
    line: socket.socket, address: tuple[Any, ...], sequence: int, clocks: MachineClocks
) -> _RoundTrip | None:
    """One question and its answer; None when none came in time."""
    # Both of our clocks at one moment, so that either can be compared.
    pair = read_clock_pair(clocks.monotonic_ns, clocks.utc_ns, tries=2)
    asked_ns = clocks.monotonic_ns()
    deadline_s = time.monotonic() + WAIT_S
    try:
        line.sendto(_packed(_Packet(_QUESTION, sequence, asked_ns)), address)
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            line.settimeout(left_s)
            data = line.recv(2048)
            back_ns = clocks.monotonic_ns()
            answer = _parsed(data, _ANSWER)
            if answer is not None and (answer.sequence, answer.asked_ns) == (sequence, asked_ns):
                break
        else:
            return None
    except OSError:  # nobody there, or no way there: the next may come through
        return None
    length_ns = (back_ns - asked_ns) - (answer.went_ns - answer.came_ns)
    middle_ns = (asked_ns + back_ns) // 2
    offset_ns = (answer.came_ns + answer.went_ns) // 2 - middle_ns
    if not 0 <= length_ns <= MOST_ROUND_TRIP_NS:
        return None
    ours_ns = pair.utc_ns - pair.monotonic_ns
    theirs_ns = answer.utc_ns - answer.monotonic_ns
    return _RoundTrip(
        length_ns, middle_ns, offset_ns, offset_ns + theirs_ns - ours_ns, answer.boot_id
    )


def _peer_clock(peer: str, trips: list[_RoundTrip], clocks: MachineClocks) -> PeerClock:
    """The shortest trip; its half, and how far the next shortest ones scatter, is the bound."""
    trips = sorted(trips, key=lambda trip: trip.length_ns)
    best = trips[0]
    near = trips[: max(LEAST_ANSWERS, round(BEST_SHARE * len(trips)))]
    offsets = [trip.offset_monotonic_ns for trip in near]
    middle = sum(offsets) / len(offsets)
    scatter = (sum((one - middle) ** 2 for one in offsets) / len(offsets)) ** 0.5
    pair = read_clock_pair(clocks.monotonic_ns, clocks.utc_ns)
    return PeerClock(
        peer=peer,
        monotonic_ns=best.middle_ns,
        utc_ns=best.middle_ns - pair.monotonic_ns + pair.utc_ns,
        offset_monotonic_ns=best.offset_monotonic_ns,
        offset_utc_ns=best.offset_utc_ns,
        uncertainty_ns=round(((0.5 * best.length_ns) ** 2 + scatter**2) ** 0.5),
        round_trip_ns=best.length_ns,
        answers=len(trips),
        boot_id=best.boot_id,
        own_boot_id=clocks.name,
    )


def _packed(packet: _Packet) -> bytes:
    name = uuid.UUID(packet.boot_id).bytes if packet.boot_id else bytes(16)
    return _PACKET.pack(
        _MAGIC, _VERSION, packet.kind, packet.sequence, packet.asked_ns, packet.came_ns,
        packet.went_ns, packet.monotonic_ns, packet.utc_ns, name,
    )  # fmt: skip


def _parsed(data: bytes, kind: int) -> _Packet | None:
    """The packet; None for what is none of ours, of another version or of the other kind."""
    if len(data) != _PACKET.size:
        return None
    magic, version, told, sequence, asked, came, went, monotonic, utc, name = _PACKET.unpack(data)
    if (magic, version, told) != (_MAGIC, _VERSION, kind):
        return None
    boot_id = str(uuid.UUID(bytes=name)) if any(name) else ""
    return _Packet(told, sequence, asked, came, went, monotonic, utc, boot_id)
