"""The devices of the virtual car, in simulated time: real drivers before emulated devices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from drivers import ModelPort, Port, Reading
from drivers.camera import CameraEmulator, Clock, ZedCamera, ZedConfig
from drivers.camera.v4l2.source import DeviceFacts, VideoMode
from drivers.imu.mpu9250 import FakeMpu9250Bus, Mpu9250, Mpu9250Config
from drivers.rplidar import LidarPort, RPLidar, RPLidarConfig, RPLidarModel, a2m8
from drivers.vesc import (
    Drive,
    DriveCommand,
    DriveLimits,
    Firmware,
    SourceMotor,
    Vesc,
    VescConfig,
    VescController,
    VescModel,
    VescValues,
)
from geometry import Floats
from simulation.build import Place
from simulation.sensors import ImuNoise, ImuWorld, LidarWorld, VescWorld
from simulation.stereo import StereoScene
from simulation.world import World

LIDAR = RPLidarConfig("/dev/rc/lidar", scan_mode="Express", rotation_hz=15.0)
"""Fifteen turns a second as the thesis, and some 270 beams a turn."""
VESC = VescConfig(port="/dev/rc/vesc")
IMU = Mpu9250Config(rate_hz=200)
ZED_RATES_HZ = (15.0, 30.0, 60.0, 100.0)
ZED = ZedConfig("/dev/rc/zed", mode="VGA", rate_hz=15.0, exposure_s=0.005)
ZED_FACTS = DeviceFacts(
    node="/dev/video1", card="ZED", driver="uvcvideo", bus="usb-emulated-2", captures=True,
    serial="12345", usb_id="2b03:f582", usb_mbit_s=5000.0,
)  # fmt: skip
LIDAR_PPM, IMU_RATE_ERROR = 30.0, 0.003
FIRMWARE = Firmware(5, 2, "410", "0a1b2c3d4e5f60718293a4b5", paired=False, beta=0)
LIMITS = DriveLimits(
    erpm_min=0.0, erpm_max=25_000.0, duty=0.5, current_a=30.0, brake_a=10.0, erpm_per_s=1e6,
    servo_min=0.0, servo_max=1.0, servo_per_s=1e3, heartbeat_s=1.0, telemetry_s=1.0,
)  # fmt: skip


@dataclass(frozen=True)
class Models:
    """The emulated devices: what a driver talks to, whatever lies between them."""

    lidar: RPLidarModel
    vesc: VescModel
    imu: ImuWorld


def models(world: World, zero_ns: int) -> Models:
    """The devices of a world; world time 0 is at `zero_ns` of the car's monotonic clock."""
    lidar = LidarWorld(
        world.drive, world.around, pose_of(world.built.lidar), zero_ns, world.rng("lidar")
    )
    imu = ImuWorld(
        world.drive, zero_ns, world.rng("imu"), ImuNoise(rate_hz=IMU.rate_hz), world.built.gyro_gain
    )
    motor = SourceMotor(VescWorld(world.drive, world.built.vesc, zero_ns))
    return Models(RPLidarModel(a2m8(), lidar, ppm=LIDAR_PPM), VescModel(FIRMWARE, motor), imu)


def pose_of(place: Place) -> Floats:
    """(3,): x, y, yaw on base_link."""
    return np.array([place.x_m, place.y_m, place.yaw_rad])


def lidar_in_simulated_time(made: Models, begins_ns: int) -> RPLidar:
    """The driver before the model, its clock starting at `begins_ns`."""
    return RPLidar(LIDAR, lambda _, baud: LidarPort(made.lidar, baud=baud, start_ns=begins_ns))


def vesc_in_simulated_time(made: Models, begins_ns: int) -> Vesc:
    """The driver that only listens, as when the car is driven by remote control."""
    return Vesc(VESC, lambda path, _: ModelPort(made.vesc, name=path, start_ns=begins_ns))


def commanded_vesc_in_simulated_time(
    world: World, made: Models, begins_ns: int, zero_ns: int
) -> DrivenVesc:
    """The driver through which the car is driven."""
    return DrivenVesc(
        world, zero_ns, lambda path, _: ModelPort(made.vesc, name=path, start_ns=begins_ns)
    )


def imu_in_simulated_time(made: Models, begins_ns: int) -> Mpu9250:
    """The IMU on its bus."""
    bus = FakeMpu9250Bus(made.imu, start_ns=begins_ns)
    bus.rate_error = IMU_RATE_ERROR
    return Mpu9250(IMU, lambda _: bus)


def zed_of(world: World, clock: Clock, zero_ns: int) -> ZedCamera:
    """The stereo camera, paced by a clock."""
    scene = StereoScene(world.cones.positions, seed=int(world.rng("stereo").integers(1 << 31)))

    def seen(t_ns: int) -> bytes:
        return scene.frame_yuyv(world.drive.poses(np.array([t_ns - zero_ns]))[0])

    camera = CameraEmulator(seen, clock, ZED_FACTS, (VideoMode("YUYV", 1344, 376, ZED_RATES_HZ),))
    return ZedCamera(ZED, camera.open)


class DrivenVesc:
    """A motor controller that is read and commanded: a `drivers.Device`.

    The commands of the drive are sent through the armed controller when their time has come; the
    car follows them because both come from the same drive.
    """

    def __init__(
        self,
        world: World,
        zero_ns: int,
        open_port: Callable[[str, int], Port],
        config: VescConfig = VESC,
    ) -> None:
        self._port: Port | None = None

        def opened(path: str, baud: int) -> Port:
            self._port = open_port(path, baud)
            return self._port

        self._controller = VescController(config, opened)
        self.counters = self._controller.counters
        self._tied = world.built.vesc
        self._commands = [
            (zero_ns + round(t_s * 1e9), wheel, steering)
            for t_s, wheel, steering in world.drive.commands.tolist()
        ]
        self._armed = ExitStack()
        self._drive: Drive | None = None

    @property
    def name(self) -> str:
        """The device and its port."""
        return self._controller.name

    def connect(self) -> None:
        """As `VescController.connect`."""
        self._controller.connect()

    def identify(self) -> Mapping[str, object]:
        """As `VescController.identify`."""
        return self._controller.identify()

    def read(self, timeout_s: float) -> Reading[VescValues | DriveCommand] | None:
        """What came next and what was commanded; a command is due every 20 ms while driving."""
        assert self._port is not None
        while self._commands and self._commands[0][0] <= self._port.now_ns():
            _, wheel, steering = self._commands.pop(0)
            self._command(wheel, steering)
        if not self._commands:
            self._armed.close()
        return self._controller.read(min(timeout_s, 0.01))

    def close(self) -> None:
        """Stop the car and give the port back."""
        self._armed.close()
        self._controller.close()

    def _command(self, wheel_m_s: float, steering_rad: float) -> None:
        if self._drive is None:
            self._drive = self._armed.enter_context(self._controller.arm(LIMITS))
        tied = self._tied
        servo = tied.steering_angle_to_servo_gain * steering_rad
        self._drive.servo(servo + tied.steering_angle_to_servo_offset)
        self._drive.rpm(tied.direction * tied.speed_to_erpm_gain * wheel_m_s)
