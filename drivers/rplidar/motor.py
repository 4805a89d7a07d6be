"""The lidar's motor: what it obeys, and the loop that holds its speed.

An A2 has an accessory board that takes PWM (units differ: the loop is closed on the measured
turns), an A1 runs while DTR is low, the S, T and C series take a speed. Source:
reference/protocols.md A.10.8.
"""

from __future__ import annotations

from enum import Enum
from typing import Protocol

from drivers.errors import NoAnswerError
from drivers.port import Port
from drivers.rplidar.conversation import Conversation
from drivers.rplidar.protocol import (
    PWM_MAX,
    Answer,
    Info,
    acc_board_request,
    decode_acc_board,
    pwm_request,
    rpm_request,
)

PWM_PER_HZ = 60.0
"""About 10 Hz at 600, the SDK's own default; the loop finds the rest."""
SLOWEST_PWM = 150
RPM_SERIES = 6
SETTLING_NS = 2_000_000_000
TOLERANCE = 0.01
LARGEST_STEP = 40


class MotorPort(Port, Protocol):
    """A port with a DTR line."""

    def set_dtr(self, level: bool) -> None:
        """Set that line."""


class MotorMethod(Enum):
    """What the motor obeys."""

    PWM = "PWM by the accessory board"
    RPM = "speed command"
    DTR = "DTR line"


def motor_method(talk: Conversation, info: Info) -> MotorMethod:
    """How the motor of this lidar is driven (SDK 2.1.0's own decision)."""
    if info.series >= RPM_SERIES:
        return MotorMethod.RPM
    if info.series >= 2:
        try:
            if decode_acc_board(talk.ask(acc_board_request(), Answer.ACC_BOARD_FLAG)):
                return MotorMethod.PWM
        except NoAnswerError:
            pass  # no accessory board: a bare UART
    return MotorMethod.DTR


class Motor:
    """Drives a motor to a rotation rate, or with a PWM that stays.

    pwm : what it was told last; None where PWM is not how it is driven.
    """

    def __init__(self, method: MotorMethod, rotation_hz: float, fixed_pwm: int | None) -> None:
        self.method = method
        self._rotation_hz, self._fixed_pwm = rotation_hz, fixed_pwm
        first = round(rotation_hz * PWM_PER_HZ) if fixed_pwm is None else fixed_pwm
        self.pwm = min(first, PWM_MAX) if method is MotorMethod.PWM else None
        self._changed_ns: int | None = None
        self._periods_s: list[float] = []

    def start(self, port: MotorPort) -> None:
        """Let it turn."""
        if self.pwm is not None:
            port.write(pwm_request(self.pwm))
        elif self.method is MotorMethod.RPM:
            port.write(rpm_request(round(60.0 * self._rotation_hz)))
        else:
            port.set_dtr(False)

    def stop(self, port: MotorPort) -> None:
        """Let it stop."""
        if self.method is MotorMethod.PWM:
            port.write(pwm_request(0))
        elif self.method is MotorMethod.RPM:
            port.write(rpm_request(0))
        else:
            port.set_dtr(True)

    def correct(self, period_s: float, now_ns: int) -> bytes | None:
        """After a turn that took so long: what to send to come nearer to the rate, if anything.

        At most every two seconds, by the mean of the turns since, so that the motor can follow; a
        turn alone is known to one beam only, which is half a per cent in a standard scan.
        """
        if self.pwm is None or self._fixed_pwm is not None or not period_s > 0.0:
            return None
        if self._changed_ns is None:
            self._changed_ns = now_ns  # it still spins up
        self._periods_s.append(period_s)
        if now_ns - self._changed_ns < SETTLING_NS:
            return None
        # The first half of them passed while the motor still followed the last change.
        late = self._periods_s[len(self._periods_s) // 2 :]
        measured_hz = len(late) / sum(late)
        self._changed_ns, self._periods_s = now_ns, []
        off_hz = self._rotation_hz - measured_hz
        if abs(off_hz) <= TOLERANCE * self._rotation_hz:
            return None
        # Half of the way each time: what a Hz costs differs from motor to motor by a third.
        step = max(-LARGEST_STEP, min(LARGEST_STEP, round(0.5 * off_hz * self.pwm / measured_hz)))
        wanted = max(SLOWEST_PWM, min(PWM_MAX, self.pwm + step))
        if wanted == self.pwm:
            return None
        self.pwm = wanted
        return pwm_request(wanted)
