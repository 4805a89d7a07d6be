"""Reads a VESC: its version first, then its state at a steady rate, one question at a time.

It sends nothing but questions (`channel.ReadChannel`). To drive, see `controller`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from drivers.device import Counters, Reading
from drivers.errors import DeviceLostError, ProtocolError
from drivers.port import Port, SerialPort
from drivers.vesc.channel import ReadChannel, Received
from drivers.vesc.firmware import Firmware
from drivers.vesc.framing import Frame
from drivers.vesc.handshake import answer, hear_version
from drivers.vesc.requests import ASK_VALUES, ReadId, ReadRequest
from drivers.vesc.values import VescValues, decode_values

PRINTS = (20, 21)
"""COMM_PRINT, before and after the ids moved."""
GIVE_UP = 2.0
"""After so many time-outs a question counts as lost and the next may be asked; a late answer that
comes before is still told from the next one's and gets its right time."""
BITS_PER_BYTE_NS = 10_000_000_000


@dataclass(frozen=True, kw_only=True)
class VescConfig:
    """How a VESC is read.

    port : device path; link : over UART the time on the wire is taken off (USB: none that counts);
    mask : fields to ask for (firmware from 3.48; `requests.ODOMETRY_MASK`), None for all;
    reply_timeout_s : then a question counts as unanswered; lost_after : so many in a row are a lost
    device. Raises `ValueError`.
    """

    port: str
    baud: int = 115200
    link: Literal["usb", "uart"] = "usb"
    rate_hz: float = 50.0
    mask: int | None = None
    reply_timeout_s: float = 0.05
    lost_after: int = 10

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.rate_hz <= 500:
            raise ValueError(f"rate_hz is more than 0 and at most 500, not {self.rate_hz}")
        if not 0 < self.reply_timeout_s <= 1 or self.lost_after < 1 or self.baud < 1:
            raise ValueError("reply_timeout_s is in (0, 1]; lost_after and baud are at least 1")
        _ = self.request  # its mask is checked there

    @property
    def request(self) -> ReadRequest:
        """The question that is asked again and again."""
        if self.mask is None:
            return ASK_VALUES
        return ReadRequest(ReadId.VALUES_SELECTIVE, self.mask)


class Vesc:
    """A VESC that is read: a `drivers.device.Device` of `VescValues`.

    It has no clock of its own, so a reading holds no ticks: a state is of the moment midway between
    question and answer, give or take half of that time.
    """

    def __init__(
        self,
        config: VescConfig,
        open_port: Callable[[str, int], Port] = SerialPort,
        *,
        open_channel: Callable[[Port], ReadChannel] = ReadChannel,
    ) -> None:
        self.config = config
        self.counters = Counters()
        self._open_port, self._open_channel = open_port, open_channel
        self._period_ns = round(1e9 / config.rate_hz)
        self._channel: ReadChannel | None = None
        self._firmware: Firmware | None = None
        self._reply_bytes = 0
        self._asked_ns: int | None = None
        self._due_ns = 0
        self._unanswered = 0
        self._counted = False
        self._given_up_ns: int | None = None

    @property
    def name(self) -> str:
        """The device and its port."""
        return f"VESC on {self.config.port}"

    @property
    def firmware(self) -> Firmware:
        """What answered. Raises `DeviceLostError` while nothing is connected."""
        if self._firmware is None:
            raise self._not_connected()
        return self._firmware

    def connect(self) -> None:
        """Open the port, learn the firmware, see that its values can be read.

        Raises `PortError`, `NoAnswerError`, `ProtocolError`, `DeviceFaultError`, `DeviceLostError`.
        """
        self.close()
        channel = self._open_channel(self._open_port(self.config.port, self.config.baud))
        self._channel = channel  # from now on `close` of another thread ends the attempt
        try:
            firmware = hear_version(channel, self.name)
            self.config.request.check(firmware)
            payload = answer(channel, self.config.request, self.name)
            decode_values(payload, firmware)
        except BaseException:
            self._channel = None
            channel.close()
            raise
        self._firmware, self._reply_bytes = firmware, len(payload)
        self._asked_ns = self._given_up_ns = None
        self._unanswered, self._due_ns = 0, channel.now_ns()

    def identify(self) -> Mapping[str, object]:
        """Firmware, hardware, processor and how it is read."""
        firmware = self.firmware
        return {
            "model": "VESC",
            "firmware": str(firmware),
            "hardware": firmware.hardware or "not told",
            "serial": firmware.uuid or "not told",
            "link": self.config.link,
            "rate_hz": self.config.rate_hz,
            "request": self.config.request.id.name,
            "mask": self.config.mask,
            "layout_bytes": self._reply_bytes,
        }

    def read(self, timeout_s: float) -> Reading[VescValues] | None:
        """What came next, asking when it is time; None if nothing came in time.

        Raises `DeviceLostError` when the port fails or `lost_after` questions stay unanswered.
        """
        channel = self._open()
        end_ns = channel.now_ns() + round(timeout_s * 1e9)
        while True:
            self._turn(channel)
            wait_ns = min(end_ns, self._next_turn_ns()) - channel.now_ns()
            received = channel.read(max(wait_ns, 0) * 1e-9)
            if received is not None:
                return Reading(raw=(received.chunk,), samples=self._take(channel, received))
            if channel.now_ns() >= end_ns:
                return None

    def ask(self, request: ReadRequest) -> bytes:
        """The payload of the answer to one other question (`decode_setup`, `decode_imu`).

        For the thread that reads. Raises `NoAnswerError`, `DeviceFaultError`, `DeviceLostError`.
        """
        request.check(self.firmware)
        self._forget_question()
        return answer(self._open(), request, self.name)

    def close(self) -> None:
        """Give the port back; nothing that this class sends moves, so there is nothing to stop."""
        channel, self._channel, self._firmware = self._channel, None, None
        if channel is not None:
            with contextlib.suppress(OSError):
                channel.close()

    def _open(self) -> ReadChannel:
        channel = self._channel
        if channel is None:
            raise self._not_connected()
        return channel

    def _not_connected(self) -> DeviceLostError:
        return DeviceLostError(f"{self.name} is not connected; connect it first")

    def _turn(self, channel: ReadChannel) -> None:
        """Ask if it is time; count what was not answered."""
        now_ns, timeout_ns = channel.now_ns(), round(self.config.reply_timeout_s * 1e9)
        if self._asked_ns is not None:
            waited_ns = now_ns - self._asked_ns
            if waited_ns >= timeout_ns and not self._counted:
                self._counted = True
                self.counters.timeouts += 1
            if waited_ns < GIVE_UP * timeout_ns:
                return
            self._give_up(channel)
        if now_ns >= self._due_ns:
            self._asked_ns, self._counted = channel.ask(self.config.request), False
            behind = (now_ns - self._due_ns) // self._period_ns
            self._count("skipped_polls", behind)
            self._due_ns += (behind + 1) * self._period_ns

    def _forget_question(self) -> None:
        if self._given_up_ns is None:
            self._given_up_ns = self._asked_ns
        self._asked_ns = None

    def _give_up(self, channel: ReadChannel) -> None:
        self._forget_question()
        self._unanswered += 1
        channel.receiver.expire()
        self._add_receiver_counts(channel)
        if self._unanswered >= self.config.lost_after:
            raise DeviceLostError(
                f"{self.name}: {self._unanswered} questions in a row stayed unanswered; check its "
                "power (the battery) and its cable"
            )

    def _next_turn_ns(self) -> int:
        if self._asked_ns is None:
            return self._due_ns
        timeout_ns = self.config.reply_timeout_s * 1e9
        return self._asked_ns + round(timeout_ns * (GIVE_UP if self._counted else 1.0))

    def _take(self, channel: ReadChannel, received: Received) -> tuple[VescValues, ...]:
        samples = []
        for frame in received.frames:
            values = self._values(frame, received.chunk.t_ns)
            if values is not None:
                samples.append(values)
        self.counters.samples += len(samples)
        self._add_receiver_counts(channel)
        return tuple(samples)

    def _values(self, frame: Frame, arrival_ns: int) -> VescValues | None:
        """The state in a frame, if the frame answers what was asked."""
        number = frame.payload[0]
        if number in PRINTS:
            self._count("prints", 1)
            return None
        if self._asked_ns is None or number != self.config.request.id:
            self._count("unexpected_frames", 1)
            return None
        earliest_ns = self._asked_ns + self._wire_ns(len(self.config.request.frame))
        latest_ns = arrival_ns - self._wire_ns(frame.following + len(frame.payload) + 5)
        middle_ns = (earliest_ns + latest_ns) // 2
        half_ns = max(latest_ns - earliest_ns, 0) // 2
        if self._given_up_ns is not None:  # it might after all be the answer to that question
            half_ns = max(half_ns, middle_ns - self._given_up_ns)
        try:
            values = decode_values(frame.payload, self.firmware, middle_ns, half_ns)
        except ProtocolError:
            self._count("undecodable_frames", 1)
            return None
        self._asked_ns = self._given_up_ns = None
        self._unanswered = 0
        return values

    def _wire_ns(self, count: int) -> int:
        usb = self.config.link == "usb"
        return 0 if usb else count * BITS_PER_BYTE_NS // self.config.baud

    def _add_receiver_counts(self, channel: ReadChannel) -> None:
        receiver = channel.receiver
        self.counters.bad_frames += receiver.bad_frames
        self.counters.bad_bytes += receiver.bad_bytes
        receiver.bad_frames = receiver.bad_bytes = 0

    def _count(self, what: str, number: int) -> None:
        if number:
            self.counters.details[what] = self.counters.details.get(what, 0) + number
