"""Listening to a Razor line by line until a deadline, and finding out which firmware it runs."""

from __future__ import annotations

from collections import deque
from enum import Enum

from drivers.device import Counters
from drivers.errors import DeviceFaultError, NoAnswerError, ProtocolError
from drivers.imu.razor.lines import NO_SENSOR, LineReader, frame_of, row_of
from drivers.imu.razor.protocol import no_sensor_text
from drivers.port import Port

USB_BAUD, AHRS_BAUD = 115200, 57600
LISTEN_S = 1.2
"""Longer than a second: the default firmware may be set to one line a second."""
LEAST_LINES = 2


class Firmware(Enum):
    """What a Razor may run."""

    DEFAULT = "SparkFun default"
    AHRS = "Razor AHRS"


class Talk:
    """A conversation in lines; `deadline_ns` is by the port's clock.

    heard : the first bytes that came, for an error message; pace_s : between the lines so far.
    """

    def __init__(self, port: Port, limit_s: float) -> None:
        self.port = port
        self.deadline_ns = port.now_ns() + round(limit_s * 1e9)
        self.heard = b""
        self._start_afresh()

    def line(self, timeout_s: float) -> bytes | None:
        """The next line, None if none came in time.

        Raises `DeviceFaultError` when the board says that it has no sensor.
        """
        end_ns = min(self.port.now_ns() + round(timeout_s * 1e9), self.deadline_ns)
        while not self._waiting:
            chunk = self.port.read((end_ns - self.port.now_ns()) * 1e-9)
            if chunk is None:
                return None
            self.heard = (self.heard + chunk.data)[:64]
            for line in self._reader.feed(chunk.data):
                self._waiting.append(line.text)
                self._arrivals_ns.append(chunk.t_ns)
        text = self._waiting.popleft()
        if text == NO_SENSOR:
            raise DeviceFaultError(f"{self.port.name}: {no_sensor_text()}")
        return text

    def unread(self, lines: list[bytes]) -> None:
        """Give back lines, to be had again."""
        self._waiting.extendleft(reversed(lines))

    @property
    def pace_s(self) -> float:
        """Mean time between the lines that came; 0 while that is not known."""
        count = len(self._arrivals_ns) - 1
        if count < 1:
            return 0.0
        return (self._arrivals_ns[-1] - self._arrivals_ns[0]) * 1e-9 / count

    def set_baud(self, baud: int) -> None:
        """Go on at another speed, with what comes from now on."""
        self.port.set_baud(baud)
        self.heard = b""
        self._start_afresh()

    def _start_afresh(self) -> None:
        # A cut first line is met with patience by who reads; at 1 Hz a whole one is worth having.
        self._reader = LineReader(Counters(), cut_at_first=False)
        self._waiting: deque[bytes] = deque()
        self._arrivals_ns: list[int] = []


def recognise(talk: Talk) -> tuple[Firmware, int | None]:
    """The firmware at the other end, and the baud rate if its line is not USB.

    A board whose stream was paused is told to go on. Raises `NoAnswerError` if it stays silent,
    `ProtocolError` if what comes is neither firmware's.
    """
    found = _listen(talk, LISTEN_S)
    if found is None and not talk.heard:
        # Silent: the default firmware may be paused (space), the AHRS firmware stopped (#o1).
        talk.port.write(b" #o1")
        found = _listen(talk, LISTEN_S)
        if found is None and not talk.heard:
            talk.port.write(b" ")  # it was no pause: leave the board as it was
    if found is not None:
        return found, None
    garbage = talk.heard
    talk.set_baud(AHRS_BAUD)
    talk.port.write(b"#o1")
    found = _listen(talk, LISTEN_S)
    if found is not None:
        return found, AHRS_BAUD
    raise _not_recognised(talk, talk.heard or garbage)


def _listen(talk: Talk, seconds: float) -> Firmware | None:
    """Whose lines these are, as soon as some are surely of one kind; they can be read again."""
    lines: list[bytes] = []
    end_ns = talk.port.now_ns() + round(seconds * 1e9)
    rows, frames = 0.0, 0
    while (left_ns := end_ns - talk.port.now_ns()) > 0:
        text = talk.line(left_ns * 1e-9)
        if text is None:
            break
        lines.append(text)
        row = row_of(text)
        if row is not None:  # an empty line, with every column off, is weak evidence
            rows += 1.0 if row.values else 0.2
        frames += frame_of(text) is not None
        if frames >= LEAST_LINES:
            return Firmware.AHRS
        if rows >= LEAST_LINES:
            talk.unread(lines)
            return Firmware.DEFAULT
        if (
            rows or b", " in text
        ) and not frames:  # lines may be as slow as one a second: wait for one more
            end_ns = max(end_ns, talk.port.now_ns() + round(LISTEN_S * 1e9))
    return None


def _not_recognised(talk: Talk, heard: bytes) -> Exception:
    name = talk.port.name
    speeds = f"{USB_BAUD} and {AHRS_BAUD} baud"
    if not heard:
        return NoAnswerError(
            f"{name}: nothing came from a Razor IMU at {speeds}; check the cable, that this is its "
            "port (trackside devices) and that its blue light blinks; a board that has lost its "
            "sensor is silent too: take its power away for ten seconds"
        )
    return ProtocolError(
        f"{name}: what comes at {speeds} is no Razor's ({heard[:24]!r} ...); is this its port "
        "(trackside devices)? The SparkFun default and the Razor AHRS firmware are understood, the "
        "latter in text mode"
    )
