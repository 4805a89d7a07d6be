"""A recorded session played again by emulated devices, byte for byte, at any speed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from capture.errors import MissingStreamError
from capture.sensor_messages import raw_bytes
from capture.session import Session
from capture.topics import RAW_IMU_TOPIC, RAW_LIDAR_TOPIC, RAW_VESC_TOPIC
from drivers import Chunk, DeviceModel, PtyEmulator
from drivers.imu.razor import razor_model
from drivers.rplidar import RPLidarModel, a2m8, replay
from drivers.rplidar.replay import MODES
from drivers.vesc import emulated_vesc


@dataclass(frozen=True)
class Replayed:
    """A device that plays: the port by which other programs open it, and how long it plays."""

    device: str
    path: str
    seconds: float


def recorded_chunks(session: Session, topic: str) -> list[Chunk]:
    """The bytes of a raw topic as they came, with log times; none if the session has none."""
    if session.log is None:
        return []
    raw = session.log.read(topic)
    times = raw.log_t_ns.tolist()
    return [Chunk(t_ns, raw_bytes(m)) for t_ns, m in zip(times, raw.messages, strict=True)]


@contextmanager
def replayed(session: Session, speed: float = 1.0) -> Iterator[tuple[Replayed, ...]]:
    """Every serial device of a session on a pseudo-terminal of its own, as long as the block lasts.

    An IMU on I2C has no port and is left out. Raises `MissingStreamError` where nothing is left.
    """
    models = {name: make(session) for name, make in _MODELS.items()}
    with ExitStack() as stack:
        playing = []
        for name, found in models.items():
            if found is not None:
                model, seconds = found
                emulator = stack.enter_context(PtyEmulator(model, speed=speed))
                playing.append(Replayed(name, emulator.path, seconds / speed))
        if not playing:
            raise MissingStreamError(
                f"{session.folder}: holds no raw bytes of a serial device (topics /raw/...), so "
                "there is nothing to replay; only what trackside record made has them"
            )
        yield tuple(playing)


_Made = tuple[DeviceModel, float] | None


def _lidar(session: Session) -> _Made:
    chunks = recorded_chunks(session, RAW_LIDAR_TOPIC)
    if not chunks:
        return None
    identity = _identity(session, "lidar")
    mode = MODES[str(identity.get("scan_mode", "Standard"))]
    baud = identity.get("baud")
    spec = dataclasses.replace(a2m8(), modes=(mode,))
    if isinstance(baud, int):
        spec = dataclasses.replace(spec, baud=baud)
    return RPLidarModel(spec, replay=replay(chunks)), _seconds(chunks)


def _vesc(session: Session) -> _Made:
    chunks = recorded_chunks(session, RAW_VESC_TOPIC)
    firmware = str(_identity(session, "vesc").get("firmware", "5.02"))
    return (emulated_vesc(firmware, chunks), _seconds(chunks)) if chunks else None


def _razor(session: Session) -> _Made:
    if "razor" not in session.info.devices:
        return None
    chunks = recorded_chunks(session, RAW_IMU_TOPIC)
    return (razor_model(chunks), _seconds(chunks)) if chunks else None


_MODELS: Mapping[str, Callable[[Session], _Made]] = {
    "lidar": _lidar,
    "vesc": _vesc,
    "razor": _razor,
}


def _identity(session: Session, device: str) -> Mapping[str, object]:
    found = session.info.devices.get(device, {})
    return found if isinstance(found, Mapping) else {}


def _seconds(chunks: list[Chunk]) -> float:
    return (chunks[-1].t_ns - chunks[0].t_ns) * 1e-9
