"""Questions and answers before the scan: who is there, at which speed, and what it can do."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from drivers.errors import DeviceFaultError, DriverError, NoAnswerError
from drivers.port import Chunk, Port, drain
from drivers.rplidar.beams import Decoder
from drivers.rplidar.dense import DenseDecoder
from drivers.rplidar.legacy import LegacyDecoder
from drivers.rplidar.protocol import (
    CONF_FIRMWARE,
    DESCRIPTOR_BYTES,
    OLD_STANDARD_US,
    SAMPLERATE_FIRMWARE,
    SCAN_ANSWERS,
    Answer,
    Command,
    Conf,
    Descriptor,
    Health,
    Info,
    ScanMode,
    conf_request,
    decode_conf,
    decode_health,
    decode_info,
    decode_number,
    decode_samplerate,
    find_descriptor,
    request,
)
from drivers.rplidar.standard import StandardDecoder
from drivers.rplidar.ultra import UltraDecoder

BAUDS = (115200, 256000, 460800, 1000000)
"""A1, A2M4 to A2M8; A2M7, A2M12, A3, S1; C1; S2 and S3. The hardware byte does not tell."""
BEST_MODES = ("Sensitivity", "Boost", "Express", "Standard")
DECODERS: Mapping[int, type[Decoder]] = MappingProxyType(
    {
        Answer.STANDARD: StandardDecoder,
        Answer.LEGACY: LegacyDecoder,
        Answer.ULTRA: UltraDecoder,
        Answer.DENSE: DenseDecoder,
    }
)
PROBE_S, ANSWER_S, BANNER_S = 0.4, 0.3, 2.5
QUIET_S, STOPPING_S = 0.05, 0.1


class Conversation:
    """Asks a lidar over a port, all before one deadline.

    heard : the last bytes that came while an answer did not.
    """

    def __init__(self, port: Port, deadline_ns: int) -> None:
        self.heard = b""
        self._port, self._deadline_ns = port, deadline_ns

    def settle(self) -> None:
        """Stop whatever runs, a scan that a program left behind too, and wait until it is quiet."""
        self._port.write(request(Command.STOP))
        self._port.pause(STOPPING_S)
        drain(self._port, quiet_s=QUIET_S, limit_s=3 * STOPPING_S)

    def ask(self, question: bytes, kind: Answer, timeout_s: float = ANSWER_S) -> bytes:
        """The answer's bytes, without its descriptor. Raises `NoAnswerError`."""
        self._port.write(question)
        _, answer = self._await((kind,), timeout_s)
        return answer.data

    def conf(self, conf: Conf, mode: int | None = None) -> bytes:
        """A value of the configuration. Raises `NoAnswerError`, `ProtocolError`."""
        return decode_conf(self.ask(conf_request(conf, mode), Answer.LIDAR_CONF), conf)

    def scan(self, timeout_s: float) -> tuple[Descriptor, Chunk]:
        """The descriptor of a scan asked for, and what came of it. Raises `NoAnswerError`."""
        return self._await(SCAN_ANSWERS, timeout_s)

    def reset(self) -> None:
        """Restart the lidar and wait until it has printed its banner, or for `BANNER_S`."""
        self._port.write(request(Command.RESET))
        end_ns = self._end_ns(BANNER_S)
        self._port.read((end_ns - self._port.now_ns()) * 1e-9)
        drain(self._port, quiet_s=2 * QUIET_S, limit_s=10 * QUIET_S)

    def _await(self, kinds: tuple[Answer, ...], timeout_s: float) -> tuple[Descriptor, Chunk]:
        """A descriptor of these types and its packet; of a scan what came behind the descriptor."""
        buffer, end_ns, t_ns = b"", self._end_ns(timeout_s), self._port.now_ns()
        while True:
            found = find_descriptor(buffer, kinds)
            if found is not None:
                at, descriptor = found
                rest = buffer[at + DESCRIPTOR_BYTES :]
                if descriptor.many:
                    return descriptor, Chunk(t_ns, rest)
                if len(rest) >= descriptor.length:
                    return descriptor, Chunk(t_ns, rest[: descriptor.length])
            left_s = (end_ns - self._port.now_ns()) * 1e-9
            chunk = self._port.read(left_s) if left_s > 0 else None
            if chunk is None:
                self.heard = buffer or self.heard
                raise NoAnswerError(f"{self._port.name}: no answer of type 0x{kinds[0]:02X}")
            buffer, t_ns = buffer + chunk.data, chunk.t_ns

    def _end_ns(self, timeout_s: float) -> int:
        return min(self._port.now_ns() + round(timeout_s * 1e9), self._deadline_ns)


def find_lidar(talk: Conversation, port: Port, bauds: tuple[int, ...]) -> tuple[int, Info]:
    """The speed at which an RPLidar answers, and who it is. Raises `NoAnswerError`.

    The first speed is tried once more at the end: a lidar that has just got power boots for 0.7 s.
    """
    for baud in (*bauds, bauds[0]):
        port.set_baud(baud)
        talk.settle()
        try:
            info = talk.ask(request(Command.GET_INFO), Answer.INFO, PROBE_S)
        except NoAnswerError:
            continue
        return baud, decode_info(info)
    raise NoAnswerError(_nobody(port.name, bauds, talk.heard))


def _nobody(name: str, bauds: tuple[int, ...], heard: bytes) -> str:
    tried = f"{', '.join(map(str, bauds))} baud"
    if not heard:
        return (
            f"{name}: no RPLidar answers at {tried}, the line is silent; check that it is the "
            "lidar's port (trackside devices), its cable, and that the adapter has power (5 V, "
            "1.5 A while the motor starts)"
        )
    other = "something else"
    if heard[:1] in (b"\x02", b"\x03"):
        other = "perhaps a VESC"
    elif heard[:1] in (b"#", b"$") or heard.isascii():
        other = "text, perhaps an IMU"
    return (
        f"{name}: no RPLidar answers at {tried}, but bytes come: {heard[:16].hex(' ')} ({other}); "
        "if another device is there, take another port (trackside devices); if it is a lidar, it "
        "runs at a speed that was not tried (`baud`), or its cable is bad"
    )


def healthy(talk: Conversation, name: str) -> Health:
    """Its health, after a reset if it is in protection stop. Raises `DeviceFaultError`."""
    health = decode_health(talk.ask(request(Command.GET_HEALTH), Answer.HEALTH))
    if health.protection_stop:
        talk.reset()
        health = decode_health(talk.ask(request(Command.GET_HEALTH), Answer.HEALTH))
    if health.protection_stop:
        raise DeviceFaultError(
            f"{name}: the lidar is in {health} and a reset did not help; see that its head turns "
            "freely and nothing covers it, unplug it for ten seconds; if it stays so it is broken"
        )
    return health


def scan_modes(talk: Conversation, info: Info) -> tuple[ScanMode, ...]:
    """Every scan mode that the lidar offers; what is known of old firmware that has no list."""
    if info.firmware >= CONF_FIRMWARE:
        try:
            count = decode_number(talk.conf(Conf.MODE_COUNT))
            return tuple(_mode(talk, number) for number in range(count))
        except DriverError:
            talk.settle()
    if info.firmware < SAMPLERATE_FIRMWARE:
        return (ScanMode(0, "Standard", Answer.STANDARD, OLD_STANDARD_US * 256, 0.0),)
    asked = talk.ask(request(Command.GET_SAMPLERATE), Answer.SAMPLERATE)
    standard_us, express_us = decode_samplerate(asked)
    return (
        ScanMode(0, "Standard", Answer.STANDARD, standard_us * 256, 0.0),
        ScanMode(0, "Express", Answer.LEGACY, express_us * 256, 0.0),
    )


def _mode(talk: Conversation, number: int) -> ScanMode:
    return ScanMode(
        number,
        talk.conf(Conf.MODE_NAME, number).split(b"\0")[0].decode("ascii", "replace"),
        decode_number(talk.conf(Conf.ANSWER_TYPE, number)),
        decode_number(talk.conf(Conf.US_PER_SAMPLE, number)),
        decode_number(talk.conf(Conf.MAX_DISTANCE, number)) / 256.0,
    )


def choose_mode(modes: tuple[ScanMode, ...], wish: str | None) -> tuple[ScanMode, str]:
    """The mode wished for, else the best that there is; and why it is another, if it is.

    Raises `DeviceFaultError` if none has answers that we decode.
    """
    usable = {m.name.casefold(): m for m in modes if m.answer in DECODERS and m.us_q8 > 0}
    names = BEST_MODES if wish is None else (wish, *BEST_MODES)
    offered = ", ".join(mode.name for mode in modes)
    if not usable:
        raise DeviceFaultError(
            f"the lidar offers the scan modes {offered or 'none at all'}, and none with answers "
            "that trackside decodes (types 0x81, 0x82, 0x84, 0x85); newer or older firmware may"
        )
    found = next((usable[n.casefold()] for n in names if n.casefold() in usable), None)
    mode = found or min(usable.values(), key=lambda m: m.us_q8)
    if mode.name.casefold() == names[0].casefold():
        return mode, ""
    return mode, f"{names[0]} is not offered ({offered}): {mode.name} instead"
