"""A Razor with the AHRS firmware, as its serial line shows it."""

from __future__ import annotations

import math
import re

from drivers.emulation import Line
from drivers.imu.razor.ahrs import COUNTS_PER_G, ITG3200_RAD_S_PER_COUNT
from drivers.imu.sample import STANDARD_GRAVITY_M_S2, Source, at_rest

INTERVAL_NS = 20_000_000
MOST_COMMAND_BYTES = 5

_COMMAND = re.compile(rb"#(?:s..|os[crb][tb]|o[01tbx])", re.DOTALL)


class AhrsModel:
    """The AHRS firmware in text mode: a `DeviceModel` driven by a source.

    extended : knows #ox and prints rad/s, as the ROS fork does; else the original, whose gyro
    counts. baud : None for USB, else of a line that shows noise to a host with another `host_baud`.
    Streams at once, as after power. Fault: errors (says that a sensor failed, at every frame).
    """

    def __init__(
        self, source: Source = at_rest, *, extended: bool = True, baud: int | None = 57600
    ) -> None:
        self.source, self.extended, self.baud = source, extended, baud
        self.host_baud = baud
        self.streams, self.mode, self.errors = True, "angles", False
        self._line = Line(baud)
        self._heard = b""
        self._next_ns: int | None = None

    def receive(self, data: bytes, now_ns: int) -> None:
        """Commands, cut anywhere; at another speed nothing is understood."""
        if self.baud is not None and self.host_baud != self.baud:
            return
        self._heard += data
        end = 0
        for found in _COMMAND.finditer(self._heard):
            self._obey(found[0], now_ns)
            end = found.end()
        self._heard = self._heard[end:][-MOST_COMMAND_BYTES:]

    def transmit(self, now_ns: int) -> bytes:
        """Frames whose time has come."""
        if self._next_ns is None:
            self._next_ns = now_ns + INTERVAL_NS
        while self._next_ns <= now_ns:
            at_ns, self._next_ns = self._next_ns, self._next_ns + INTERVAL_NS
            if self.streams:
                self._line.send(self._text(at_ns), at_ns)
        sent = self._line.due(now_ns)
        if self.baud is not None and self.host_baud != self.baud:
            return bytes(byte | 0x80 for byte in sent)
        return sent

    def next_ns(self) -> int | None:
        """When the next bytes are due."""
        if self._next_ns is None:
            return 0
        waiting_ns = self._line.next_ns()
        if not self.streams:
            return waiting_ns
        return self._next_ns if waiting_ns is None else min(waiting_ns, self._next_ns)

    def _obey(self, command: bytes, now_ns: int) -> None:
        if command[1:2] == b"s":
            self._line.send(b"#SYNCH" + command[2:] + b"\r\n", now_ns)
        elif command[2:] in (b"0", b"1"):
            self.streams = command[2:] == b"1"
        elif command[2:] == b"t":
            self.mode = "angles"
        elif command[2:] == b"x" and self.extended:
            self.mode = "both"
        elif command[2:] == b"sct":
            self.mode = "sensors"

    def _text(self, at_ns: int) -> bytes:
        motion = self.source(at_ns)
        yaw, pitch, roll = (math.degrees(angle) for angle in motion.yaw_pitch_roll_rad)
        angles = (-yaw, -pitch, roll)
        ax, ay, az = (
            value * COUNTS_PER_G / STANDARD_GRAVITY_M_S2
            for value in motion.linear_acceleration_m_s2
        )
        gx, gy, gz = motion.angular_velocity_rad_s
        if not self.extended:
            gx, gy, gz = (value / ITG3200_RAD_S_PER_COUNT for value in (gx, gy, gz))
        accel, gyro = (-ax, ay, az), (gx, -gy, -gz)
        text = b"!ERR: reading magnetometer\r\n" if self.errors else b""
        if self.mode == "angles":
            return text + _frame("YPR", *angles)
        if self.mode == "both":
            return text + _frame("YPRAG", *angles, *accel, *gyro)
        field = (10.0, 20.0, 30.0)
        return text + _frame("A-C", *accel) + _frame("M-C", *field) + _frame("G-C", *gyro)


def _frame(tag: str, *values: float) -> bytes:
    return f"#{tag}={','.join(f'{value:.2f}' for value in values)}\r\n".encode()
