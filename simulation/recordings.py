"""The two recordings of a drive, each on the clock of its machine: the car's, and the film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from capture import ClockPair, GroundTruth, SessionInfo
from capture.clock import UtcLine
from capture.recording.camera import CameraTranslator
from capture.recording.imu import ImuTranslator
from capture.recording.lidar import LidarTranslator
from capture.recording.rig import Rig
from capture.recording.rig_streams import IMAGES_WAITING
from capture.recording.simulated_time import record_in_simulated_time
from capture.recording.still import StillPeriod
from capture.recording.stream import Stream
from capture.recording.vesc import VescTranslator
from capture.topics import OVERHEAD_LOG_NAME, OVERHEAD_TOPIC, ZED_LOG_NAME, ZED_TOPIC
from capture.yaml_file import plain
from drivers.camera import CameraEmulator, FreeClock, V4l2Camera, V4l2Config, ZedCamera
from drivers.imu.mpu9250 import Mpu9250
from drivers.rplidar import RPLidar
from drivers.vesc import Vesc
from geometry import View
from simulation.instruments import (
    IMU,
    LIDAR,
    VESC,
    ZED,
    DrivenVesc,
    commanded_vesc_in_simulated_time,
    imu_in_simulated_time,
    lidar_in_simulated_time,
    models,
    vesc_in_simulated_time,
    zed_of,
)
from simulation.overhead_film import EXPOSURE_S, FilmClock, FilmScene
from simulation.world import START_UTC_NS, World

CAR_ZERO_NS = 5_000_000_000_000
"""World time 0 on the car's monotonic clock: its computer is up for an hour and a half."""
SPIN_UP_NS = 4_000_000_000
SETTLE_NS = 1_000_000_000
"""A camera gives its first frame within so long."""
STILL_S = 2.0
FILM_BEFORE_NS = 1_300_000_000
"""So much earlier than world time 0 the film begins: the cones' rings are measured standing."""
OVERHEAD = V4l2Config("/dev/v4l/by-id/overhead", exposure_s=EXPOSURE_S)
MOST_OFFSET_S, MOST_SKEW = 2.0, 20e-6

Advance = Callable[[float], None]


@dataclass(frozen=True)
class CarClock:
    """The car's clocks: world time 0 on its monotonic one, and the line to UTC."""

    zero_ns: int = CAR_ZERO_NS
    utc: UtcLine = UtcLine(CAR_ZERO_NS, START_UTC_NS)  # noqa: RUF009  frozen

    @property
    def zero_utc_ns(self) -> int:
        """World time 0 on the clock of the car's log."""
        return self.utc.utc(self.zero_ns)


def information(world: World, utc: UtcLine, rig: Rig, trial: int | None) -> SessionInfo:
    """What `session.yaml` says before a device has spoken."""
    begun = datetime.fromtimestamp(utc.utc_ns * 1e-9, timezone.utc)
    return SessionInfo(
        map=world.map,
        power=world.power,
        trial=trial,
        start_utc=begun.isoformat("T", "seconds"),
        clocks=(ClockPair(monotonic_ns=utc.monotonic_ns, utc_ns=utc.utc_ns),),
        configuration={"rig": plain(rig)},
        notes=f"simulated, seed {world.seed}",
        origin={"simulated": {"map": world.map, "power": world.power, "seed": world.seed}},
    )


def car_rig(world: World) -> Rig:
    """The rig of the car, with the figures of its plan."""
    return Rig(lidar=LIDAR, vesc=VESC, vesc_calibration=world.drawn.vesc, mpu9250=IMU, zed=ZED)


def car_streams(
    world: World,
    utc: UtcLine,
    *,
    lidar: RPLidar,
    vesc: Vesc | DrivenVesc,
    imu: Mpu9250,
    zed: ZedCamera | None,
) -> dict[str, Stream]:
    """The car's devices with what makes messages of them; zed : None for a car without one."""
    still = StillPeriod()
    streams = {
        "lidar": Stream(lidar, LidarTranslator(utc), LIDAR.rotation_hz),
        "vesc": Stream(vesc, VescTranslator(utc, world.drawn.vesc), VESC.rate_hz),
        "mpu9250": Stream(imu, ImuTranslator(utc, still), still=still),
    }
    if zed is not None:
        pairs = CameraTranslator(utc, ZED_TOPIC, ZED_LOG_NAME, "zed_left")
        streams["zed"] = Stream(zed, pairs, ZED.rate_hz, IMAGES_WAITING)
    return streams


def record_car(
    world: World,
    folder: Path,
    *,
    trial: int | None = None,
    commanded: bool = False,
    stereo: bool = True,
    clock: CarClock = CarClock(),
    advance: Advance = lambda _: None,
) -> SessionInfo:
    """The car's recording of a drive, in a folder that exists and is empty.

    commanded : driven through the motor controller, so that its steering is on record, not by
    remote control; stereo : with the ZED.
    """
    made, begins_ns = models(world, clock.zero_ns), clock.zero_ns - SPIN_UP_NS
    streams = car_streams(
        world,
        clock.utc,
        lidar=lidar_in_simulated_time(made, begins_ns),
        vesc=commanded_vesc_in_simulated_time(world, made, begins_ns, clock.zero_ns)
        if commanded
        else vesc_in_simulated_time(made, begins_ns),
        imu=imu_in_simulated_time(made, begins_ns),
        zed=zed_of(world, FreeClock(clock.zero_ns - SETTLE_NS), clock.zero_ns) if stereo else None,
    )
    return record_in_simulated_time(
        folder,
        information(world, clock.utc, car_rig(world), trial),
        streams,
        clock.utc,
        starts_ns=clock.zero_ns,
        ends_ns=clock.zero_ns + world.drive.end_ns,
        still_s=STILL_S,
        advance=advance,
    )


def film_clock(world: World, car: CarClock = CarClock()) -> tuple[FilmClock, UtcLine]:
    """The clocks of the machine that films: nobody has set them by the car's."""
    rng = world.rng("clock")
    offset_s = float(rng.uniform(-MOST_OFFSET_S, MOST_OFFSET_S))
    skew = float(rng.uniform(-MOST_SKEW, MOST_SKEW))
    zero_ns = int(rng.integers(1_000, 9_000)) * 1_000_000_000
    return FilmClock(zero_ns, skew), UtcLine(zero_ns, car.zero_utc_ns - round(offset_s * 1e9))


def record_film(
    world: World,
    view: View,
    folder: Path,
    *,
    trial: int | None = None,
    car: CarClock = CarClock(),
    advance: Advance = lambda _: None,
) -> SessionInfo:
    """The film of a drive, in a folder that exists and is empty, on the film's own clock."""
    clock, utc = film_clock(world, car)
    scene = FilmScene(world, view)
    begins_ns = clock.own_ns(-FILM_BEFORE_NS)
    camera = CameraEmulator(lambda t_ns: scene.jpeg(clock.world_ns(t_ns)), FreeClock(begins_ns))
    images = CameraTranslator(utc, OVERHEAD_TOPIC, OVERHEAD_LOG_NAME, "overhead")
    size = view.camera
    config = replace(OVERHEAD, width_px=size.width_px, height_px=size.height_px)
    return record_in_simulated_time(
        folder,
        information(world, utc, Rig(overhead=config), trial),
        {"overhead": Stream(V4l2Camera(config, camera.open), images, config.rate_hz)},
        utc,
        starts_ns=begins_ns,
        ends_ns=clock.own_ns(world.drive.end_ns),
        advance=advance,
    )


def film_to_car(world: World, car: CarClock = CarClock()) -> tuple[float, float]:
    """What makes a stamp of the film one of the car's clock: offset in s at world time 0, skew.

    t_car = t_film + offset + skew * (t_film - t_film at world time 0).
    """
    clock, utc = film_clock(world, car)
    offset_s = (car.zero_utc_ns - utc.utc(clock.zero_ns)) * 1e-9
    return offset_s, 1.0 / (1.0 + clock.skew) - 1.0


def exact_truth(world: World, car: CarClock = CarClock()) -> GroundTruth:
    """Where car and cones really were, on the clock of the car's log."""
    offset_s, skew = film_to_car(world, car)
    made: dict[str, object] = {
        "made_by": "trackside simulate, exact",
        "map": world.map,
        "power": world.power,
        "seed": world.seed,
        "film_clock": {"offset_s": offset_s, "skew": skew},
        "built": plain(world.built),
        "drawn": plain(world.drawn),
    }
    return GroundTruth(world.drive.path(car.zero_utc_ns), world.cones, made)
