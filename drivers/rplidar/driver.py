"""The RPLidar as a device: connect, read whole revolutions, close."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from dialogue import UsageError
from drivers.device import Counters, Reading, Tick
from drivers.errors import DeviceLostError, DriverError, NoAnswerError, ProtocolError
from drivers.port import Chunk, SerialPort
from drivers.rplidar.beams import Decoder, Newest
from drivers.rplidar.conversation import (
    BAUDS,
    DECODERS,
    Conversation,
    choose_mode,
    find_lidar,
    healthy,
    scan_modes,
)
from drivers.rplidar.motor import Motor, MotorPort, motor_method
from drivers.rplidar.protocol import PWM_MAX, Command, Health, Info, ScanMode, request, scan_request
from drivers.rplidar.revolution import Revolution, RevolutionSplitter
from drivers.rplidar.slips import SlipWatch

CONNECT_S = 4.8
START_S = 0.5
SPIN_UP_S = 6.0
SILENCE_S = 1.0
NONSENSE_S = 2.0
LAPSE_NS = 50_000_000
"""So much time without its bytes may be a whole turn, of which the angles tell nothing."""
KERNEL_BYTES = 4095
"""What a terminal holds for a program that does not read."""
DEAF_NS = 100_000_000
CLOSING_S = 0.02
BYTE_BITS = 10


@dataclass(frozen=True)
class RPLidarConfig:
    """What to connect to, and how.

    port : a path, best under /dev/serial/by-id; baud : None tries all that RPLidars have;
    scan_mode : its name, None for the best there is; rotation_hz : held by a loop on the measured
    turns; motor_pwm : 0 to 1023, a fixed PWM instead of the loop (accessory board only).
    Raises `UsageError`.
    """

    port: str
    baud: int | None = None
    scan_mode: str | None = None
    rotation_hz: float = 10.0
    motor_pwm: int | None = None

    def __post_init__(self) -> None:
        if not 2.0 <= self.rotation_hz <= 20.0:
            raise UsageError(
                f"rotation_hz: {self.rotation_hz} is not within 2 .. 20 (an A2 can 5 to 15)"
            )
        if self.motor_pwm is not None and not 1 <= self.motor_pwm <= PWM_MAX:
            raise UsageError(f"motor_pwm: {self.motor_pwm} is not within 1 .. {PWM_MAX}")


@dataclass(frozen=True)
class _Found:
    """What the conversation brought."""

    baud: int
    info: Info
    health: Health
    mode: ScanMode
    why: str
    answer: int


@dataclass
class _Session:
    """A scan that runs: what is known of it, and how far it is."""

    found: _Found
    decoder: Decoder
    splitter: RevolutionSplitter
    first_epoch: int
    begun_ns: int
    waiting: Chunk | None
    slips: SlipWatch = field(default_factory=SlipWatch)
    last_ns: int | None = None
    good_ns: int | None = None
    deaf_until_ns: int = 0


def open_serial(path: str, baud: int) -> MotorPort:
    """The machine's own port with DTR low, as an A1's motor wants it."""
    return SerialPort(path, baud, dtr=False)


class RPLidar:
    """An RPLidar of the A series on a serial port; a `drivers.Device[Revolution]`.

    `Counters.samples` and `lost_samples` count beams; `details` has `revolutions`,
    `torn_revolutions` (dropped since they were no single turn), `epochs` (breaks of the count).
    """

    def __init__(
        self,
        config: RPLidarConfig,
        open_port: Callable[[str, int], MotorPort] = open_serial,
    ) -> None:
        self.counters = Counters(details={"revolutions": 0, "torn_revolutions": 0, "epochs": 0})
        self._config, self._open_port = config, open_port
        self._lock = threading.Lock()
        self._port: MotorPort | None = None
        self._motor: Motor | None = None
        self._session: _Session | None = None
        self._ending = False
        self._seen = (0, 0, 0, 0)
        self._epoch = -1

    @property
    def name(self) -> str:
        """`RPLidar on /dev/ttyUSB0`."""
        return f"RPLidar on {self._config.port}"

    def connect(self) -> None:
        """Stop what runs, find out who is there, start motor and scan.

        Raises `PortError`, `NoAnswerError`, `DeviceFaultError`, `DeviceLostError`, `ProtocolError`.
        """
        self.close()
        self._ending = False
        bauds = BAUDS if self._config.baud is None else (self._config.baud,)
        port = self._open_port(self._config.port, bauds[0])
        try:
            self._unless_closed(lambda: setattr(self, "_port", port))
            session = self._begin(port, bauds)
            self._unless_closed(lambda: setattr(self, "_session", session))
        except BaseException:
            self.close()
            port.close()
            raise

    def identify(self) -> Mapping[str, object]:
        """Who it is and how it scans; the port alone while it is not connected."""
        session, motor = self._session, self._motor
        known: dict[str, object] = {"port": self._config.port}
        if session is None or motor is None:
            return known
        found = session.found
        return known | {
            "model": found.info.model_name,
            "firmware": "{}.{:02d}".format(*found.info.firmware),
            "hardware": found.info.hardware,
            "serial": found.info.serial,
            "health": str(found.health),
            "scan_mode": found.mode.name,
            "scan_mode_note": found.why,
            "answer_type": f"0x{found.answer:02X}",
            "us_per_sample": found.mode.us_per_sample,
            "max_distance_m": found.mode.max_distance_m,
            "baud": found.baud,
            "motor": motor.method.value,
            "motor_pwm": motor.pwm,
            "rotation_hz": self._config.rotation_hz,
        }

    def read(self, timeout_s: float) -> Reading[Revolution] | None:
        """One read of the port: its bytes, a tick of the sample clock, the turns it completed.

        Raises `DeviceLostError` when it is silent, `NoAnswerError` when it never began (the motor
        has `SPIN_UP_S`), `ProtocolError` when for `NONSENSE_S` nothing could be decoded.
        """
        session, port = self._session, self._port
        if session is None or port is None:
            raise DeviceLostError(f"{self.name}: not connected")
        chunk, session.waiting = session.waiting or port.read(timeout_s), None
        if chunk is None:
            self._check_silence(session, port.now_ns())
            return None
        if chunk.t_ns < session.deaf_until_ns:
            session.last_ns = chunk.t_ns
            return Reading(raw=(chunk,))
        self._check_lapse(session, chunk)
        beams = session.decoder.feed(chunk.data)
        session.last_ns = chunk.t_ns
        session.good_ns = session.good_ns or chunk.t_ns
        ticks = self._ticks(session, chunk)
        if session.slips.has_slipped(ticks):
            session.decoder.break_count()
        turns = session.splitter.feed(beams)
        self._count(session, len(beams), len(turns))
        for turn in turns:
            self._correct(port, turn.period_s, chunk.t_ns)
        return Reading(raw=(chunk,), ticks=ticks, samples=turns)

    def close(self) -> None:
        """Stop scan and motor, and give the port back."""
        with self._lock:
            self._ending = True
            port, motor = self._port, self._motor
            self._port = self._motor = self._session = None
        if port is None:
            return
        with contextlib.suppress(DriverError):
            port.write(request(Command.STOP))
        with contextlib.suppress(DriverError):
            if motor is not None:
                motor.stop(port)
        # What is written just before a port closes may never leave it (SkoltechRobotics #33).
        port.pause(CLOSING_S)
        port.close()

    def _begin(self, port: MotorPort, bauds: tuple[int, ...]) -> _Session:
        talk = Conversation(port, port.now_ns() + round(CONNECT_S * 1e9))
        baud, info = find_lidar(talk, port, bauds)
        try:
            health = healthy(talk, self.name)
            method = motor_method(talk, info)
            mode, why = choose_mode(scan_modes(talk, info), self._config.scan_mode)
            motor = Motor(method, self._config.rotation_hz, self._config.motor_pwm)
            self._motor = motor
            self._unless_closed(lambda: motor.start(port))
            answer, first = self._start(port, talk, mode)
        except NoAnswerError as err:
            self.counters.timeouts += 1
            raise NoAnswerError(
                f"{self.name}: {info.model_name} said who it is and then stopped "
                f"answering ({err}); check its power (5 V, 1.5 A while the motor starts), its cable"
            ) from err
        self._epoch += 1
        self._seen = (0, 0, 0, 0)
        return _Session(
            _Found(baud, info, health, mode, why, answer),
            DECODERS[answer](),
            RevolutionSplitter(mode.us_q8, first_epoch=self._epoch),
            self._epoch,
            port.now_ns(),
            first if first.data else None,
        )

    def _unless_closed(self, act: Callable[[], object]) -> None:
        """Do what close() undoes, so that it cannot be done after it."""
        with self._lock:
            if self._ending:
                raise DeviceLostError(f"{self.name}: closed while it was being connected")
            act()

    def _start(self, port: MotorPort, talk: Conversation, mode: ScanMode) -> tuple[int, Chunk]:
        """The type of answers that the scan really gives, and what came of them already."""

        def ask() -> tuple[int, Chunk]:
            self._unless_closed(lambda: port.write(scan_request(mode)))
            descriptor, first = talk.scan(START_S)
            return descriptor.kind, first

        try:
            return ask()
        except NoAnswerError:
            self.counters.timeouts += 1
            talk.settle()
            return ask()

    def _check_silence(self, session: _Session, now_ns: int) -> None:
        if session.last_ns is None:
            if now_ns - session.begun_ns > SPIN_UP_S * 1e9:
                raise NoAnswerError(
                    f"{self.name}: the scan was accepted but no beam came in {SPIN_UP_S:.0f} s; "
                    "the head does not turn, or too slowly: check the motor's power (5 V, 1.5 A) "
                    "and that nothing blocks it"
                )
        elif now_ns - session.last_ns > SILENCE_S * 1e9:
            raise DeviceLostError(
                f"{self.name}: silent for {SILENCE_S:.0f} s in the middle of a scan; check its "
                "power and its cable (a motor that starts may pull the 5 V down)"
            )

    def _check_lapse(self, session: _Session, chunk: Chunk) -> None:
        """Begin a new epoch where more time passed than the bytes account for.

        Those that are missing came before these; or, if we came so late that the kernel was full,
        behind them, and somewhere in what then still stands in the adapter.
        """
        if session.last_ns is None:
            return
        if session.deaf_until_ns:
            session.deaf_until_ns = 0
            session.decoder.break_count()
            return
        decoder, mode = session.decoder, session.found.mode
        packets = len(chunk.data) / decoder.packet_bytes
        accounted_ns = packets * decoder.packet_samples * mode.us_per_sample * 1e3
        if chunk.t_ns - session.last_ns - accounted_ns > LAPSE_NS:
            if len(chunk.data) >= KERNEL_BYTES:
                session.deaf_until_ns = chunk.t_ns + DEAF_NS
            else:
                decoder.break_count()

    def _ticks(self, session: _Session, chunk: Chunk) -> tuple[Tick, ...]:
        newest = session.decoder.newest
        if newest is None:
            if chunk.t_ns - (session.good_ns or chunk.t_ns) > NONSENSE_S * 1e9:
                raise ProtocolError(
                    f"{self.name}: for {NONSENSE_S:.0f} s nothing that came was a piece of a scan, "
                    f"at last {chunk.data[:16].hex(' ')}; check the cable, and that no other "
                    "program uses the port"
                )
            return ()
        session.good_ns = chunk.t_ns
        return (self._tick(session, chunk, newest),)

    def _tick(self, session: _Session, chunk: Chunk, newest: Newest) -> Tick:
        """A.11: a packet's last beam is as old as its time on the wire and 1.5 sample periods."""
        found, packet_bytes = session.found, session.decoder.packet_bytes
        byte_ns = BYTE_BITS * 1e9 / found.baud
        period_ns = found.mode.us_per_sample * 1e3
        return Tick(
            device_ns=newest.index * found.mode.us_q8 * 125 // 32,
            arrival_ns=chunk.t_ns - round(newest.bytes_after * byte_ns),
            delay_ns=round(packet_bytes * byte_ns + 1.5 * period_ns),
            epoch=session.first_epoch + newest.epoch,
        )

    def _count(self, session: _Session, beams: int, turns: int) -> None:
        decoder, counters = session.decoder, self.counters
        now = (
            decoder.bad_frames,
            decoder.bad_bytes,
            decoder.lost_samples,
            session.splitter.torn,
        )
        frames, skipped, lost, torn = (new - old for new, old in zip(now, self._seen, strict=True))
        self._seen = now
        counters.samples += beams
        counters.bad_frames += frames
        counters.bad_bytes += skipped
        counters.lost_samples += lost
        counters.details["revolutions"] += turns
        counters.details["torn_revolutions"] += torn
        if decoder.newest is not None:
            self._epoch = session.first_epoch + decoder.newest.epoch
            counters.details["epochs"] = self._epoch

    def _correct(self, port: MotorPort, period_s: float, now_ns: int) -> None:
        """Send the motor's next step, unless close() has stopped it meanwhile."""
        with self._lock:
            motor = self._motor
            if motor is None:
                return
            step = motor.correct(period_s, now_ns)
            if step is not None:
                port.write(step)
