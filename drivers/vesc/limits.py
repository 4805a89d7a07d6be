"""What a car may be told: values held inside limits, and how fast they may grow."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from drivers.vesc.commands import Kind


@dataclass(frozen=True, kw_only=True)
class DriveLimits:
    """The limits of one armed block; what is not limited by a default must be decided.

    erpm_min, erpm_max : electrical turns a minute, backward and forward; duty, current_a, brake_a :
    largest magnitudes; servo_min, servo_max : in 0 to 1. *_per_s : how fast a command may grow;
    towards zero, motor commands pass at once. heartbeat_s : the motor is stopped when the user's
    program has not commanded for so long; telemetry_s : or the VESC has not told its state;
    stop_brake_a : 0 lets the car coast when it is stopped, more brakes it.
    Raises `ValueError` for limits that are none.
    """

    erpm_min: float
    erpm_max: float
    duty: float
    current_a: float
    brake_a: float
    erpm_per_s: float
    duty_per_s: float = 1.0
    current_a_per_s: float = 100.0
    servo_min: float = 0.15
    servo_max: float = 0.85
    servo_per_s: float = 10.0
    heartbeat_s: float = 0.2
    telemetry_s: float = 0.5
    stop_brake_a: float = 0.0

    def __post_init__(self) -> None:
        """Check every number."""
        numbers = {field.name: float(getattr(self, field.name)) for field in fields(self)}
        wrong = [name for name, number in numbers.items() if not math.isfinite(number)]
        wrong += [name for name, number in numbers.items() if number < 0 and name != "erpm_min"]
        wrong += [name for name in ("heartbeat_s", "telemetry_s") if not 0 < numbers[name] <= 1]
        if wrong:
            raise ValueError(f"{', '.join(wrong)}: not negative, and times in (0, 1] s")
        if not self.erpm_min <= 0 <= self.erpm_max or self.duty > 1:
            raise ValueError("expected erpm_min <= 0 <= erpm_max and duty <= 1")
        if not self.servo_min <= self.servo_max <= 1:
            raise ValueError("expected 0 <= servo_min <= servo_max <= 1")
        if self.stop_brake_a > self.brake_a:
            raise ValueError("stop_brake_a is more than brake_a allows")

    def held(self, kind: Kind, asked: float, before: float | None, seconds: float) -> float:
        """The value that may be sent instead of `asked`.

        before : of the same kind, in force since `seconds` ago; None: not known.
        """
        low, high = self._range(kind)
        value = min(max(asked, low), high)
        if before is None:
            return value
        if kind == "servo":
            step = self.servo_per_s * seconds
            return min(max(value, before - step), before + step)
        rates = {
            "rpm": self.erpm_per_s,
            "duty": self.duty_per_s,
            "current": self.current_a_per_s,
        }
        return _grown(value, before, rates[kind] * seconds) if kind in rates else value

    def _range(self, kind: Kind) -> tuple[float, float]:
        ranges: dict[Kind, tuple[float, float]] = {
            "rpm": (self.erpm_min, self.erpm_max),
            "duty": (-self.duty, self.duty),
            "current": (-self.current_a, self.current_a),
            "brake": (0.0, self.brake_a),
            "handbrake": (0.0, self.brake_a),
            "servo": (self.servo_min, self.servo_max),
            "alive": (0.0, 0.0),
        }
        return ranges[kind]


def _grown(value: float, before: float, step: float) -> float:
    """`value`, its magnitude at most a step above what was; a change of sign starts from zero."""
    base = abs(before) if value * before > 0 else 0.0
    return math.copysign(min(abs(value), base + step), value)
