"""The whole rig on emulated devices at real pace, in which every sample tells its own true time.

Lidar and motor controller live in a process of their own, behind pseudo-terminals; the IMU's bus
and the camera have no port and live beside the recorder, whose share of a core therefore includes
them. Both processes read one monotonic clock, so true times can be compared.
"""

from __future__ import annotations

import functools
import math
import multiprocessing
import resource
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import numpy.typing as npt

from capture.clock import UtcLine, read_clock_pair
from capture.recording.camera import CameraTranslator
from capture.recording.imu import ImuTranslator
from capture.recording.lidar import LidarTranslator
from capture.recording.recorder import Limits, Recorder
from capture.recording.stream import Stream
from capture.recording.verdict import Verdict
from capture.recording.vesc import VescTranslator
from capture.session_info import SessionInfo
from capture.topics import OVERHEAD_LOG_NAME, OVERHEAD_TOPIC
from drivers import DeviceModel, PtyEmulator
from drivers.camera import CameraEmulator, RealClock, V4l2Camera, V4l2Config
from drivers.imu import Motion
from drivers.imu.mpu9250 import Mpu9250, Mpu9250Config, RealTimeMpu9250Bus
from drivers.rplidar import RPLidar, RPLidarConfig, RPLidarModel, a2m8
from drivers.vesc import Firmware, SourceMotor, Vesc, VescConfig, VescModel, VescValues

IMU_HZ, VESC_HZ, CAMERA_HZ, LIDAR_HZ = 200, 50.0, 30.0, 10.0
JPEG_BYTES = 500_000
RAMP_NS = 1_000_000_000
RAMP_RAD_S = 15.0
"""The gyro turns faster and faster for a second, then begins again: its rate tells the time."""
COUNT_NS = 1000
"""The tachometer counts microseconds."""
LIDAR_PPM, IMU_ERROR = 40.0, 0.004


def told_by_gyro(t_ns: int) -> Motion:
    """A rate that grows by `RAMP_RAD_S` in each second."""
    rate = RAMP_RAD_S * (t_ns % RAMP_NS) / RAMP_NS
    return Motion(angular_velocity_rad_s=(0.0, 0.0, rate))


def told_by_tachometer(t_ns: int) -> VescValues:
    """A state whose tachometer is the time in microseconds, as far as 32 bits hold it."""
    counts = (t_ns // COUNT_NS + 2**31) % 2**32 - 2**31
    return VescValues(
        t_ns, 0, fet_celsius=30.0, motor_celsius=30.0, motor_current_a=1.0, input_current_a=1.0,
        d_current_a=0.0, q_current_a=1.0, duty=0.1, erpm=3000.0, input_voltage_v=11.7,
        charge_drawn_coulomb=1.0, charge_regained_coulomb=0.0, energy_drawn_joule=1.0,
        energy_regained_joule=0.0, tachometer=counts, tachometer_abs=counts, fault=0,
        position_rad=0.0, controller_id=1, mosfet_1_celsius=30.0, mosfet_2_celsius=30.0,
        mosfet_3_celsius=30.0, d_voltage_v=0.0, q_voltage_v=1.0,
    )  # fmt: skip


def told_by_image(t_ns: int) -> bytes:
    """A JPEG of half a megabyte with the time of its exposure in a comment."""
    comment = b"\xff\xfe" + struct.pack(">H", 10) + struct.pack(">Q", t_ns)
    whole = _jpeg()
    return whole[:2] + comment + whole[2:]


def time_in_image(data: bytes) -> int:
    """What `told_by_image` put in."""
    (t_ns,) = struct.unpack_from(">Q", data, 6)
    return int(t_ns)


@functools.cache
def _jpeg() -> bytes:
    """Noise over a gradient, of about the size of a real frame of 1080p at quality 90."""
    import cv2

    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[0:1080, 0:1920]
    image = (rows + columns) / 12.0 + rng.normal(0.0, 3.3, (1080, 1920))
    good, data = cv2.imencode(".jpg", np.clip(image, 0, 255).astype(np.uint8), [1, 90])
    assert good
    return bytes(data)


class Kept:
    """A device that keeps every byte it sends, in order, with the host's questions as breaks.

    since_question : what was sent after the last time the host said something that matters.
    """

    def __init__(self, model: DeviceModel, questions: Callable[[bytes], bool]) -> None:
        self.model, self._questions = model, questions
        self.sent = bytearray()

    def receive(self, data: bytes, now_ns: int) -> None:
        if self._questions(data):
            self.sent.clear()
        self.model.receive(data, now_ns)

    def transmit(self, now_ns: int) -> bytes:
        data = self.model.transmit(now_ns)
        self.sent += data
        return data

    def next_ns(self) -> int | None:
        return self.model.next_ns()


@dataclass
class Emulated:
    """The process of the devices behind ports: their paths, and what they sent at the end."""

    pipe: Connection
    process: multiprocessing.process.BaseProcess
    lidar_path: str = ""
    vesc_path: str = ""
    sent: dict[str, bytes] = field(default_factory=dict)
    lidar_true_ns: tuple[int, int] = (0, 0)

    @classmethod
    def start(cls) -> Emulated:
        """Begin; both ports can be opened afterwards."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_emulate, args=(theirs,), daemon=True)
        process.start()
        emulated = cls(ours, process)
        emulated.lidar_path, emulated.vesc_path = ours.recv()
        return emulated

    def look(self) -> None:
        """Ask what was sent until now."""
        self.pipe.send("look")
        self.sent, self.lidar_true_ns = self.pipe.recv()

    def stop(self) -> None:
        """End it."""
        self.pipe.send("stop")
        self.process.join(10.0)


LIDAR_SAMPLES = 1_000_000
_SCANS = (b"\xa5\x82", b"\xa5\x20")


def _emulate(pipe: Connection) -> None:
    """The other process: two devices, until it is told to stop."""
    lidar = RPLidarModel(replace(a2m8()), ppm=LIDAR_PPM)
    firmware = Firmware(5, 2, "410", bytes(12).hex(), paired=False, beta=0)
    vesc = VescModel(firmware, SourceMotor(told_by_tachometer))
    kept = {
        "lidar": Kept(lidar, lambda data: any(scan in data for scan in _SCANS)),
        "vesc": Kept(vesc, lambda data: data[2:3] == b"\x00"),
    }
    # The true times are those of the scan that runs, so they are noted while it runs.
    true_ns = (0, 0)
    with PtyEmulator(kept["lidar"]) as one, PtyEmulator(kept["vesc"]) as other:
        pipe.send((one.path, other.path))
        while pipe.recv() != "stop":
            if lidar.state == "scanning":
                first, last = lidar.true_ns(np.array([0, LIDAR_SAMPLES])).tolist()
                true_ns = (first, last)
            pipe.send(({name: bytes(device.sent) for name, device in kept.items()}, true_ns))


@dataclass(frozen=True)
class Use:
    """What a recording took: a share of one core, and memory in MB near its start and its end."""

    core_share: float
    memory_mb: tuple[float, float]
    most_waiting: int
    verdict: Verdict


def rig_streams(emulated: Emulated, utc: UtcLine, *, camera: bool) -> dict[str, Stream]:
    """The streams of the whole rig."""
    bus = RealTimeMpu9250Bus(told_by_gyro, start_ns=time.monotonic_ns())
    bus.rate_error = IMU_ERROR
    imu = Mpu9250(Mpu9250Config(rate_hz=IMU_HZ), lambda _: bus)
    vesc = Vesc(VescConfig(port=emulated.vesc_path, rate_hz=VESC_HZ))
    lidar = RPLidar(RPLidarConfig(emulated.lidar_path, rotation_hz=LIDAR_HZ))
    streams = {
        "lidar": Stream(lidar, LidarTranslator(utc), LIDAR_HZ),
        "vesc": Stream(vesc, VescTranslator(utc), VESC_HZ),
        "mpu9250": Stream(imu, ImuTranslator(utc), IMU_HZ),
    }
    if camera:
        source = CameraEmulator(told_by_image, RealClock())
        device = V4l2Camera(V4l2Config("/dev/v4l/by-id/emulated", exposure_s=0.005), source.open)
        images = CameraTranslator(utc, OVERHEAD_TOPIC, OVERHEAD_LOG_NAME, "overhead")
        streams["overhead"] = Stream(device, images, CAMERA_HZ, 300)
    return streams


def record(folder: Path, emulated: Emulated, seconds: float, *, camera: bool) -> Use:
    """Record the rig for a while and measure this process meanwhile."""
    _jpeg()
    pair = read_clock_pair()
    utc = UtcLine(pair.monotonic_ns, pair.utc_ns)
    streams = rig_streams(emulated, utc, camera=camera)
    recorder = Recorder(
        folder, SessionInfo(map="rig", clocks=(pair,)), streams, utc, Limits(seconds)
    )
    wait = multiprocessing.Event().wait
    memory_mb: list[float] = []
    with recorder:
        while not recorder.is_ready:
            recorder.poll()
            wait(0.2)
        cpu_s, wall_s = _cpu_s(), time.monotonic()
        while not recorder.is_over():
            recorder.poll()
            memory_mb.append(_memory_mb())
            wait(0.2)
        share = (_cpu_s() - cpu_s) / (time.monotonic() - wall_s)
        emulated.look()  # while the lidar scans its true times are known
    emulated.look()
    quarter = max(len(memory_mb) // 4, 1)
    memory = (max(memory_mb[:quarter]), max(memory_mb[-quarter:]))
    return Use(share, memory, recorder.most_waiting, recorder.verdict())


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _memory_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() * 1e-6


Errors = npt.NDArray[np.float64]


def gyro_error_s(stamp_ns: int, rate_rad_s: float, utc: UtcLine) -> float:
    """By how much a stamp is late against the time that the rate tells."""
    true_ns = rate_rad_s / RAMP_RAD_S * RAMP_NS
    monotonic_ns = stamp_ns - utc.utc(0)
    return math.remainder((monotonic_ns % RAMP_NS) - true_ns, RAMP_NS) * 1e-9


def tachometer_error_s(stamp_ns: int, counts: int, utc: UtcLine) -> float:
    """By how much a stamp is late against the time that the tachometer tells."""
    micros = ((stamp_ns - utc.utc(0)) // COUNT_NS + 2**31) % 2**32 - 2**31
    return math.remainder(micros - counts, 2**32) * COUNT_NS * 1e-9
