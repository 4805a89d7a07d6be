"""Driving through one armed block: every command limited, and stopped when anything is silent."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from typing import Literal

from drivers.errors import DriverError, NotArmedError
from drivers.vesc.channel import DriveChannel
from drivers.vesc.commands import Kind, encode_command
from drivers.vesc.faults import fault_name
from drivers.vesc.firmware import Firmware
from drivers.vesc.limits import DriveLimits
from drivers.vesc.values import VescValues

STOP_FRAMES = 3
"""How often the stop is sent: nothing acknowledges it, and a single frame can be lost."""


@dataclass(frozen=True)
class DriveCommand:
    """What was commanded at `t_ns` (monotonic): for the record, beside the states.

    asked, sent : before and after the limits; duty, A, ERPM or servo 0 to 1, as `kind` says. A
    `stop` ends the armed block for the reason it gives.
    """

    t_ns: int
    kind: Kind | Literal["stop"]
    asked: float
    sent: float
    reason: str = ""


class Drive:
    """Commands to the car, from any one thread, until it is stopped; then `NotArmedError`.

    Each method gives what was sent. What is no number stops the car. After a stop, for whatever
    reason, the car has to be armed anew.
    """

    def __init__(
        self, channel: DriveChannel, firmware: Firmware, limits: DriveLimits, values: VescValues
    ) -> None:
        self.limits = limits
        self._channel, self._firmware, self._values = channel, firmware, values
        # Guards the state together with what is written: nothing may follow a stop.
        self._lock = threading.RLock()
        self._log: list[DriveCommand] = []
        self._why_stopped: str | None = None
        self._motor: DriveCommand | None = None
        self._servo: DriveCommand | None = None
        self._armed_ns = self._beat_ns = channel.now_ns()

    @property
    def why_stopped(self) -> str | None:
        """The reason of the stop; None while it is armed."""
        return self._why_stopped

    def rpm(self, erpm: float) -> DriveCommand:
        """Hold a speed, in ERPM (`VescCalibration.speed_to_erpm_gain`)."""
        return self._send("rpm", erpm)

    def duty(self, duty: float) -> DriveCommand:
        """Hold a share of the battery's voltage, -1 to 1."""
        return self._send("duty", duty)

    def current(self, current_a: float) -> DriveCommand:
        """Drive with a motor current; 0 lets the car coast."""
        return self._send("current", current_a)

    def brake(self, current_a: float) -> DriveCommand:
        """Brake with a motor current."""
        return self._send("brake", current_a)

    def handbrake(self, current_a: float) -> DriveCommand:
        """Hold the standing car with a motor current. `DeviceFaultError` before firmware 3.07."""
        return self._send("handbrake", current_a)

    def servo(self, position: float) -> DriveCommand:
        """Steer; 0 to 1. While the motor drives, this alone does not keep it driving."""
        return self._send("servo", position)

    def alive(self) -> DriveCommand:
        """Let the last motor command stay in force: the user's program is still there."""
        return self._send("alive", 0.0)

    def stop(self, reason: str = "the program asked for it") -> None:
        """Stop the car and end the armed block; from any thread, as often as wished, no error."""
        with self._lock:
            self._stop(reason)

    def watch(self, values: VescValues | None) -> None:
        """Take note of a state and of the time; called again and again by the device's thread."""
        with self._lock:
            if values is not None:
                self._values = values
            self._check()

    def taken(self) -> list[DriveCommand]:
        """What was commanded since the last call."""
        with self._lock:
            commands, self._log = self._log, []
        return commands

    def _send(self, kind: Kind, asked: float) -> DriveCommand:
        with self._lock:
            self._check()
            if self._why_stopped is not None:
                raise NotArmedError(
                    f"{kind} was not sent, the car is stopped: {self._why_stopped}; arm it again"
                )
            if not math.isfinite(asked):
                return self._stop(f"{kind} was {asked}")
            now_ns = self._channel.now_ns()
            sent = self.limits.held(kind, asked, *self._in_force(kind, now_ns))
            command = encode_command(self._firmware, kind, sent)
            try:
                t_ns = self._channel.command(command)
            except DriverError as err:
                self._stop(f"{kind} could not be sent ({err})")
                raise
            return self._note(DriveCommand(t_ns, kind, asked, sent))

    def _note(self, command: DriveCommand) -> DriveCommand:
        self._log.append(command)
        driven = self._motor is not None
        if command.kind == "servo":
            self._servo = command
        elif command.kind != "alive":
            self._motor = command
        if command.kind != "servo" or not driven:
            self._beat_ns = command.t_ns
        return command

    def _in_force(self, kind: Kind, now_ns: int) -> tuple[float | None, float]:
        """The value from which a command starts to grow, and the seconds it had for growing."""
        last = self._servo if kind == "servo" else self._motor
        since_ns = self._armed_ns if last is None else last.t_ns
        seconds = min((now_ns - since_ns) * 1e-9, self.limits.heartbeat_s)
        if last is not None and last.kind == kind:
            return last.sent, seconds
        measured = {
            "rpm": self._values.erpm,
            "duty": self._values.duty,
            "current": self._values.motor_current_a,
        }
        value = measured.get(kind)
        return (0.0 if value is not None and math.isnan(value) else value), seconds

    def _check(self) -> None:
        """Stop if anything has been silent for too long, or the VESC reports a fault."""
        if self._why_stopped is not None:
            return
        now_ns = self._channel.now_ns()
        if self._values.fault:
            self._stop(f"the VESC reports a fault: {fault_name(self._values.fault)}")
        elif now_ns - self._beat_ns >= self.limits.heartbeat_s * 1e9:
            self._stop(f"no command came for {self.limits.heartbeat_s} s")
        elif now_ns - self._values.t_ns >= self.limits.telemetry_s * 1e9:
            self._stop(
                f"the VESC has told nothing for {self.limits.telemetry_s} s (does a DeviceReader "
                "read it?)"
            )

    def _stop(self, reason: str) -> DriveCommand:
        if self._why_stopped is not None:
            return DriveCommand(self._channel.now_ns(), "stop", 0.0, 0.0, self._why_stopped)
        self._why_stopped = reason
        brake_a = self.limits.stop_brake_a
        command = encode_command(self._firmware, "brake" if brake_a else "current", brake_a)
        try:
            t_ns = self._channel.command(command, times=STOP_FRAMES)
        except DriverError as err:
            # The VESC's own watchdog takes over: it hears nothing any more.
            t_ns, reason = self._channel.now_ns(), f"{reason}; the stop was not delivered ({err})"
        stop = DriveCommand(t_ns, "stop", 0.0, brake_a, reason)
        self._log.append(stop)
        return stop
