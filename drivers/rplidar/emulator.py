"""An RPLidar as its serial line shows it: `RPLidarModel`, behind a `ModelPort` or a `PtyEmulator`.

States: idle, scanning, resetting (0.67 s, then the banner), protection stop. Times, answers and
oddities are those of reference/protocols.md A.10 and its emulator checklist (part I).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.emulation import Line, ModelPort
from drivers.rplidar.protocol import (
    ANSWER_BYTES,
    CONF_FIRMWARE,
    SAMPLERATE_FIRMWARE,
    SCAN_ANSWERS,
    SYNC,
    Answer,
    Command,
    Conf,
    Descriptor,
    Health,
    Info,
    ScanMode,
    banner_of,
    checksum,
)
from drivers.rplidar.scene import SAMPLES, Rotor, Scan, Source, Stream, room

BOOT_NS = 671_000_000
REQUEST_NS = 5_000_000_000
PWM_PER_HZ = 60.0
_NO_WORD = bytes((index * 167 + 13) % 256 for index in range(256))
"""What a line at another speed makes of each byte: nothing that anybody understands."""

STANDARD = ScanMode(0, "Standard", Answer.STANDARD, 508 * 256, 12.0)
EXPRESS = ScanMode(1, "Express", Answer.LEGACY, 254 * 256, 12.0)
BOOST = ScanMode(2, "Boost", Answer.ULTRA, 127 * 256, 12.0)
SENSITIVITY = ScanMode(3, "Sensitivity", Answer.ULTRA, 127 * 256, 12.0)
STABILITY = ScanMode(4, "Stability", Answer.ULTRA, 201 * 256, 12.0)
DENSE = ScanMode(3, "DenseBoost", Answer.DENSE, 127 * 256, 12.0)
THREE_MODES = (STANDARD, EXPRESS, BOOST)
FIVE_MODES = (*THREE_MODES, SENSITIVITY, STABILITY)
SERIAL = "ABB69AF2C1EA9FC2A2EB92F138653C00"


@dataclass(frozen=True)
class LidarSpec:
    """What kind of lidar it is; `a2m8()` gives the usual ones.

    modes : their places are their numbers on the wire.
    accessory_board : whether the motor obeys SET_MOTOR_PWM; else it obeys the DTR line (A1), or an
    rpm command where the series is 6 or more. pwm_per_hz : units differ.
    """

    info: Info
    modes: tuple[ScanMode, ...]
    baud: int = 115200
    samplerate_us: tuple[int, int] = (508, 254)
    accessory_board: bool = True
    pwm_per_hz: float = PWM_PER_HZ

    def __post_init__(self) -> None:
        for mode in self.modes:
            answer = Answer(mode.answer)
            bits = 1e7 * ANSWER_BYTES[answer] / (SAMPLES[answer] * mode.us_per_sample)
            if bits > self.baud:
                raise ValueError(f"{mode.name} needs {bits:.0f} baud, the line has {self.baud}")


def a2m8(firmware: tuple[int, int] = (1, 29)) -> LidarSpec:
    """An A2M8: five modes from firmware 1.29 on, three before, no list of modes before 1.24."""
    modes = FIVE_MODES if firmware >= (1, 29) else THREE_MODES
    return LidarSpec(Info(0x28, firmware, 5, SERIAL), modes)


@dataclass
class Faults:
    """What can go wrong; a test sets it at any time.

    silent : nothing leaves any more; drop_bytes : so many bytes of the scan vanish; flip_bits : so
    many packets have one bit turned; restart : the next capsule has the S bit set, as after an
    unsteady rotation; noise : bytes that leave in place of the next packet; protection_stop : the
    lidar refuses to scan, and a reset cures it if `reset_cures`.
    """

    silent: bool = False
    drop_bytes: int = 0
    flip_bits: int = 0
    restart: bool = False
    noise: bytes = b""
    protection_stop: bool = False
    reset_cures: bool = True


class RPLidarModel:
    """The device; a `drivers.DeviceModel`.

    source : what the beams hit; replay : makes a stream of recorded bytes that is sent instead, of
    its first time; ppm : how slow the sample clock is; usb_frame_ns : what has left waits for the
    next multiple of it, as behind a USB adapter.
    host_baud : the speed of the host's side, None where nobody knows; dtr : the state of that line.
    """

    def __init__(
        self,
        spec: LidarSpec | None = None,
        source: Source | None = None,
        *,
        replay: Callable[[int], Stream] | None = None,
        ppm: float = 0.0,
        usb_frame_ns: int = 0,
    ) -> None:
        self.spec = spec or a2m8()
        self.faults = Faults()
        self.rotor = Rotor()
        self.host_baud: int | None = None
        self.state = "idle"
        self._source, self._replay, self._ppm = source or room(), replay, ppm
        self._usb_frame_ns = usb_frame_ns
        self._line = Line(self.spec.baud)
        self._asked = bytearray()
        self._asked_ns = self._booted_ns = self._scan_ns = 0
        self._mode: ScanMode | None = None
        self._needs_rotation = True
        self._stream: Stream | None = None
        self._flipped = 0

    def true_ns(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """When samples of the scan that runs were measured, counted from its first."""
        if not isinstance(self._stream, Scan):
            raise RuntimeError("no scan of a source is running")
        return self._stream.true_ns(index)

    def set_dtr(self, level: bool, now_ns: int) -> None:
        """Move the DTR line, which stops the motor of a lidar without an accessory board."""
        if not self.spec.accessory_board and self.spec.info.series < 6:
            self.rotor.drive(0.0 if level else 10.0, now_ns)

    def left_scanning(self, mode: ScanMode, now_ns: int) -> None:
        """As a program left it that died: turning, scanning, streaming."""
        self.rotor.jump(10.0, now_ns)
        self._scan(mode, now_ns, needs_rotation=True)
        self._line.clear()

    def receive(self, data: bytes, now_ns: int) -> None:
        """Requests of the host; at another speed it cannot read them."""
        if self.host_baud not in (None, self.spec.baud):
            return
        self._advance(now_ns)
        if self._asked and now_ns - self._asked_ns > REQUEST_NS:
            self._asked.clear()
        if not self._asked:
            self._asked_ns = now_ns
        self._asked += data
        while (found := self._next_request()) is not None:
            if self.state != "resetting":
                self._obey(*found, now_ns)

    def transmit(self, now_ns: int) -> bytes:
        """What has left by now."""
        self._advance(now_ns)
        if self._usb_frame_ns:
            now_ns -= now_ns % self._usb_frame_ns
        data = self._line.due(now_ns)
        if self.faults.silent:
            return b""
        return data if self.host_baud in (None, self.spec.baud) else data.translate(_NO_WORD)

    def next_ns(self) -> int | None:
        """When there is next something to do."""
        times = [self._line.next_ns()]
        if self._stream is not None:
            times.append(self._stream.ready_ns())
        if self.state == "resetting":
            times.append(self._booted_ns)
        elif self._mode is not None and self._stream is None:
            times.append(self._begin_ns())
        due = min((t for t in times if t is not None), default=None)
        frame = self._usb_frame_ns
        return due if due is None or not frame else -(-due // frame) * frame

    def _advance(self, now_ns: int) -> None:
        """Let happen what is due."""
        if self.state == "resetting" and now_ns >= self._booted_ns:
            self.state = "idle"
            self._line.send(banner_of(self.spec.info), self._booted_ns)
        if self._mode is not None and self._stream is None:
            begin_ns = self._begin_ns()
            if begin_ns is not None and begin_ns <= now_ns:
                self._stream = self._begin(self._mode, begin_ns)
        while self._stream is not None:
            ready_ns = self._stream.ready_ns()
            if ready_ns is None or ready_ns > now_ns:
                break
            packet = self._stream.take(restart=self.faults.restart)
            self.faults.restart = False
            self._line.send(self._spoilt(packet), ready_ns)

    def _begin_ns(self) -> int | None:
        """When the first sample will be measured: not before the head turns steadily."""
        return self.rotor.steady_ns(self._scan_ns) if self._needs_rotation else self._scan_ns

    def _begin(self, mode: ScanMode, begin_ns: int) -> Stream:
        if self._replay is not None:
            return self._replay(begin_ns)
        return Scan(mode, self.rotor, self._source, begin_ns, ppm=self._ppm)

    def _spoilt(self, packet: bytes) -> bytes:
        faults = self.faults
        if faults.noise:
            packet, faults.noise = faults.noise, b""
        if faults.flip_bits and packet:
            faults.flip_bits -= 1
            bits = int.from_bytes(packet, "little") ^ 1 << self._flipped % (8 * len(packet))
            packet, self._flipped = bits.to_bytes(len(packet), "little"), self._flipped + 37
        lost = min(faults.drop_bytes, len(packet))
        faults.drop_bytes -= lost
        return packet[lost:]

    def _next_request(self) -> tuple[int, bytes] | None:
        """The next whole request with a right checksum; others are passed over, as is noise."""
        asked = self._asked
        while len(asked) >= 2:
            if asked[0] != SYNC:
                del asked[0]
                continue
            size = 2
            if asked[1] & 0x80:
                size = asked[2] + 4 if len(asked) > 2 else 4
            if len(asked) < size:
                return None
            whole = bytes(asked[:size])
            del asked[:size]
            if size == 2 or checksum(whole) == 0:
                return whole[1], whole[3:-1]
        return None

    def _obey(self, command: int, payload: bytes, now_ns: int) -> None:
        if command == Command.SET_MOTOR_PWM:
            if self.spec.accessory_board and len(payload) == 2:
                hz = int.from_bytes(payload, "little") / self.spec.pwm_per_hz
                self.rotor.drive(hz, now_ns)
            return  # the accessory board's own: a scan goes on
        if command == Command.HQ_MOTOR_SPEED:
            if self.spec.info.series >= 6 and len(payload) == 2:
                self.rotor.drive(int.from_bytes(payload, "little") / 60.0, now_ns)
            return
        self._mode, self._stream = None, None
        self.state = "idle"
        if command == Command.RESET:
            self._line.clear()
            self.state, self._booted_ns = "resetting", now_ns + BOOT_NS
            if self.faults.reset_cures:
                self.faults.protection_stop = False
        elif command in (Command.SCAN, Command.FORCE_SCAN, Command.EXPRESS_SCAN):
            mode = self._wanted(command, payload)
            if mode is not None and not self.faults.protection_stop:
                self._scan(mode, now_ns, needs_rotation=command != Command.FORCE_SCAN)
        else:
            self._reply(*self._answer(command, payload), now_ns)

    def _wanted(self, command: int, payload: bytes) -> ScanMode | None:
        """The mode that a request starts; express 0 gives legacy capsules on most firmware."""
        mode = self._mode_at(payload[0]) if len(payload) == 5 else None
        kind = Answer.LEGACY if command == Command.EXPRESS_SCAN else Answer.STANDARD
        if command == Command.EXPRESS_SCAN and (mode is None or mode.answer != Answer.STANDARD):
            return mode
        return next((mode for mode in self.spec.modes if mode.answer == kind), None)

    def _mode_at(self, number: int) -> ScanMode | None:
        return self.spec.modes[number] if number < len(self.spec.modes) else None

    def _scan(self, mode: ScanMode, now_ns: int, *, needs_rotation: bool) -> None:
        answer = Answer(mode.answer)
        assert answer in SCAN_ANSWERS
        self._line.send(Descriptor(answer, ANSWER_BYTES[answer], many=True).encode(), now_ns)
        self.state, self._mode, self._stream = "scanning", mode, None
        self._needs_rotation = needs_rotation and self._replay is None
        self._scan_ns = now_ns

    def _reply(self, kind: int, payload: bytes, now_ns: int) -> None:
        if payload:
            head = Descriptor(kind, len(payload), many=False).encode()
            self._line.send(head + payload, now_ns)

    def _answer(self, command: int, payload: bytes) -> tuple[int, bytes]:
        """Type and bytes of an answer; no bytes where this firmware stays silent."""
        firmware = self.spec.info.firmware
        if command == Command.GET_INFO:
            return Answer.INFO, self.spec.info.encode()
        if command == Command.GET_HEALTH:
            status = Health(2, 0x8001) if self.faults.protection_stop else Health(0, 0)
            return Answer.HEALTH, status.encode()
        if command == Command.GET_SAMPLERATE and firmware >= SAMPLERATE_FIRMWARE:
            return Answer.SAMPLERATE, struct.pack("<HH", *self.spec.samplerate_us)
        if command == Command.GET_LIDAR_CONF and firmware >= CONF_FIRMWARE:
            return Answer.LIDAR_CONF, self._conf(payload)
        if command == Command.GET_ACC_BOARD_FLAG:
            return Answer.ACC_BOARD_FLAG, struct.pack("<I", int(self.spec.accessory_board))
        return 0, b""

    def _conf(self, payload: bytes) -> bytes:
        """An answer to GET_LIDAR_CONF: the question repeated, then its value."""
        conf = int.from_bytes(payload[:4], "little")
        mode = self._mode_at(int.from_bytes(payload[4:6], "little"))
        if mode is None or conf not in list(Conf):
            return b""
        values = {
            Conf.MODE_COUNT: struct.pack("<H", len(self.spec.modes)),
            Conf.TYPICAL_MODE: struct.pack("<H", len(self.spec.modes) - 1),
            Conf.US_PER_SAMPLE: struct.pack("<I", mode.us_q8),
            Conf.MAX_DISTANCE: struct.pack("<I", round(mode.max_distance_m * 256)),
            Conf.ANSWER_TYPE: bytes((mode.answer,)),
            Conf.MODE_NAME: mode.name.encode() + b"\0",
        }
        return payload[:4] + values[Conf(conf)]


class LidarPort(ModelPort):
    """A `ModelPort` whose speed and DTR line reach the model."""

    model: RPLidarModel

    def __init__(self, model: RPLidarModel, *, baud: int = 115200, start_ns: int = 0) -> None:
        super().__init__(model, start_ns=start_ns)
        self.bauds.append(baud)
        model.host_baud = baud

    def set_baud(self, baud: int) -> None:
        """Change the speed of the line; bytes that wait are dropped."""
        super().set_baud(baud)
        self.model.host_baud = baud

    def set_dtr(self, level: bool) -> None:
        """Move the DTR line."""
        super().set_dtr(level)
        self.model.set_dtr(level, self.now_ns())
