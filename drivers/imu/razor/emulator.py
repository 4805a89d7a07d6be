"""A Razor M0 with SparkFun's default firmware, as its serial line shows it; and a recorded one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from drivers.emulation import Line
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.protocol import accel_scale, accelerometer_axes, gyro_scale
from drivers.imu.razor.columns import FACTORY, NAMES, QUATERNION_ONE, Columns
from drivers.imu.razor.lines import NO_SENSOR
from drivers.imu.razor.protocol import WRAP_MS
from drivers.imu.sample import STANDARD_GRAVITY_M_S2, Motion, Source, at_rest, quaternion_wxyz
from drivers.port import Chunk

DMP_RATE_HZ = 200
"""The DMP divides this by a whole number, so that 90 Hz is in fact 100 Hz."""
REPEAT_AFTER_NS = 10_000_000


class RazorModel:
    """The default firmware: a `DeviceModel` driven by a source.

    What is in flash can be set and read: columns, paused, rate_hz, accel_range_g, gyro_range_deg_s,
    sd_logging; flash_writes counts what wore it. Faults: skip_every (each n-th line is missing, as
    when the compass is late), starts_cut (the first line begins in its middle), no_sensor (says so
    once and is silent), deaf (takes no keys), hung (streams nothing). `reset()` is its button.
    """

    def __init__(
        self, source: Source = at_rest, *, columns: Columns = FACTORY, boot_ms: int = 1000
    ) -> None:
        self.source, self.columns = source, columns
        self.paused = self.sd_logging = False
        self.rate_hz = 100
        self.accel_range_g, self.gyro_range_deg_s = 2, 2000
        self.flash_writes = 0
        self.skip_every = 0
        self.starts_cut = True
        self.no_sensor = self.deaf = self.hung = False
        self._line = Line()
        self._boot_ms = boot_ms
        self._booted_ns: int | None = None
        self._taken = 0
        self._next_ns = 0

    def reset(self, now_ns: int) -> None:
        """Start again: millis() from 0, settings from flash."""
        self._line.clear()
        self._boot_ms, self._booted_ns = 0, now_ns
        self._next_ns = now_ns + self._period_ns()
        if self.no_sensor:
            self._line.send(NO_SENSOR + b"\r\n", now_ns)

    def receive(self, data: bytes, now_ns: int) -> None:
        """Keys, one byte each; what is none does nothing."""
        self._wake(now_ns)
        if self.deaf or self.no_sensor:
            return
        for key in data.decode("latin-1"):
            self._press(key, now_ns)

    def transmit(self, now_ns: int) -> bytes:
        """Lines whose time has come."""
        self._wake(now_ns)
        while self._next_ns <= now_ns:
            at_ns, self._next_ns = self._next_ns, self._next_ns + self._period_ns()
            self._take(at_ns)
        return self._line.due(now_ns)

    def next_ns(self) -> int | None:
        """When the next line is due."""
        waiting_ns = self._line.next_ns()
        if self.paused or self.no_sensor or self.hung or self._booted_ns is None:
            return waiting_ns if self._booted_ns is not None else 0
        return self._next_ns if waiting_ns is None else min(waiting_ns, self._next_ns)

    def _wake(self, now_ns: int) -> None:
        if self._booted_ns is None:
            boot_ms = self._boot_ms
            self.reset(now_ns)
            self._boot_ms = boot_ms

    def _period_ns(self) -> int:
        return 1_000_000_000 * max(DMP_RATE_HZ // self.rate_hz, 1) // DMP_RATE_HZ

    def _take(self, at_ns: int) -> None:
        """One sample, printed unless something is in its way."""
        self._taken += 1
        if self.paused or self.no_sensor or self.hung:
            return
        if self.skip_every and self._taken % self.skip_every == 0:
            return
        text = self._text(at_ns)
        if self.starts_cut:
            text, self.starts_cut = text[len(text) // 2 :], False
        self._line.send(text, at_ns)

    def _text(self, at_ns: int) -> bytes:
        assert self._booted_ns is not None
        elapsed_ms = (at_ns - self._booted_ns) // 1_000_000
        millis = (self._boot_ms + elapsed_ms) % WRAP_MS
        values = self._values(self.source(at_ns), millis)
        words = [
            f"{value:.{digits}f}"
            for value, digits in zip(values, self.columns.decimals(), strict=True)
        ]
        return ", ".join(words).encode() + b"\r\n"

    def _values(self, motion: Motion, millis: int) -> list[float]:
        accel = accel_scale(self.accel_range_g)
        gyro = gyro_scale(self.gyro_range_deg_s)
        groups: dict[str, list[float]] = {
            "time": [float(millis)],
            "accel": _counted(motion.linear_acceleration_m_s2, accel),
            "gyro": _counted(motion.angular_velocity_rad_s, gyro),
            "mag": _counted(
                accelerometer_axes(motion.magnetic_field_t), reg.AK_TESLA_PER_COUNT_16_BIT
            ),
            "quaternion": [
                round(part * QUATERNION_ONE) for part in quaternion_wxyz(*motion.yaw_pitch_roll_rad)
            ],
            "euler": [math.degrees(motion.yaw_pitch_roll_rad[k]) for k in (1, 2, 0)],
            "heading": [math.degrees(motion.yaw_pitch_roll_rad[0]) % 360.0],
        }
        if not self.columns.raw:
            units = {
                "accel": accel / STANDARD_GRAVITY_M_S2,
                "gyro": math.degrees(gyro),
                "mag": 0.15,
                "quaternion": 1.0 / QUATERNION_ONE,
            }
            for name, unit in units.items():
                groups[name] = [value * unit for value in groups[name]]
        return [value for name in self.columns.places() for value in groups[name]]

    def _press(self, key: str, now_ns: int) -> None:
        if key in NAMES:
            self.columns = self.columns.toggled(key)
        elif key == " ":
            self.paused = not self.paused
        elif key == "s":
            self.sd_logging = not self.sd_logging
        elif key == "r":
            step = 10 if self.rate_hz == 1 else self.rate_hz + 10
            self.rate_hz = 1 if step > 100 else step
            self._say(f"IMU rate set to {self.rate_hz} Hz", now_ns)
            self._next_ns = min(self._next_ns, now_ns + self._period_ns())
        elif key == "A":
            self.accel_range_g = _after(self.accel_range_g, reg.ACCEL_RANGES_G)
            self._say(f"Accel FSR set to +/-{self.accel_range_g} g", now_ns)
        elif key == "G":
            self.gyro_range_deg_s = _after(self.gyro_range_deg_s, reg.GYRO_RANGES_DEG_S)
            self._say(f"Gyro FSR set to +/-{self.gyro_range_deg_s} dps", now_ns)
        else:
            return
        self.flash_writes += 1

    def _say(self, text: str, now_ns: int) -> None:
        self._line.send(text.encode() + b"\r\n", now_ns)


class ReplayModel:
    """Recorded chunks, sent again at the pace at which they came; deaf to whatever is said.

    repeat : begin again at the end, else it falls silent.
    """

    def __init__(self, chunks: Sequence[Chunk], *, repeat: bool = False) -> None:
        self._chunks, self._repeat = chunks, repeat
        self._next = 0
        self._shift_ns: int | None = None

    def receive(self, data: bytes, now_ns: int) -> None:
        """Nothing: a recording does not listen."""

    def transmit(self, now_ns: int) -> bytes:
        """Chunks whose time has come, counted from the first call."""
        sent = b""
        if self._shift_ns is None:
            self._begin(now_ns)
        while (due_ns := self.next_ns()) is not None and due_ns <= now_ns:
            sent += self._chunks[self._next].data
            self._next += 1
            if self._next == len(self._chunks) and self._repeat:
                self._begin(now_ns + REPEAT_AFTER_NS)
        return sent

    def next_ns(self) -> int | None:
        """When the next chunk is due."""
        if self._next >= len(self._chunks):
            return None
        return 0 if self._shift_ns is None else self._chunks[self._next].t_ns + self._shift_ns

    def _begin(self, at_ns: int) -> None:
        """Let the first chunk be due then."""
        self._next = 0
        self._shift_ns = at_ns - self._chunks[0].t_ns if self._chunks else 0


def razor_model(
    replay: Sequence[Chunk] | None = None, *, source: Source = at_rest, columns: Columns = FACTORY
) -> RazorModel | ReplayModel:
    """What `PtyEmulator` can put behind a port: a board moved by a source, or one recorded."""
    if replay is not None:
        return ReplayModel(replay, repeat=True)
    return RazorModel(source, columns=replace(columns))


def _counted(values: tuple[float, float, float], unit: float) -> list[float]:
    return [float(max(min(round(value / unit), 32767), -32768)) for value in values]


def _after(value: int, ring: tuple[int, ...]) -> int:
    return ring[(ring.index(value) + 1) % len(ring)]
