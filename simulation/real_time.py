"""The car's recording at real pace: emulated devices behind pseudo-terminals, the real recorder."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from capture import SessionInfo
from capture.clock import UtcLine, read_clock_pair
from capture.recording.recorder import Limits, Recorder
from drivers import PtyEmulator, SerialPort
from drivers.camera import RealClock
from drivers.imu.mpu9250 import Mpu9250, RealTimeMpu9250Bus
from drivers.rplidar import RPLidar
from drivers.vesc import Vesc
from simulation.instruments import (
    IMU,
    IMU_RATE_ERROR,
    LIDAR,
    VESC,
    DrivenVesc,
    models,
    zed_of,
)
from simulation.recordings import (
    SPIN_UP_NS,
    STILL_S,
    Advance,
    CarClock,
    car_rig,
    car_streams,
    information,
)
from simulation.world import World

POLL_S = 0.1


def real_time_clock() -> CarClock:
    """World time 0 in a few seconds, when the lidar has spun up, on this machine's clocks."""
    pair = read_clock_pair()
    return CarClock(pair.monotonic_ns + SPIN_UP_NS, UtcLine(pair.monotonic_ns, pair.utc_ns))


def record_car_in_real_time(
    world: World,
    folder: Path,
    *,
    clock: CarClock,
    trial: int | None = None,
    commanded: bool = False,
    stereo: bool = True,
    advance: Advance = lambda _: None,
) -> SessionInfo:
    """As `recordings.record_car`, in as much time as the drive takes."""
    made = models(world, clock.zero_ns)
    bus = RealTimeMpu9250Bus(made.imu, start_ns=time.monotonic_ns())
    bus.rate_error = IMU_RATE_ERROR
    with ExitStack() as stack:
        lidar = stack.enter_context(PtyEmulator(made.lidar))
        vesc = stack.enter_context(PtyEmulator(made.vesc))
        config = replace(VESC, port=vesc.path)
        streams = car_streams(
            world,
            clock.utc,
            lidar=RPLidar(replace(LIDAR, port=lidar.path)),
            vesc=DrivenVesc(world, clock.zero_ns, SerialPort, config)
            if commanded
            else Vesc(config),
            imu=Mpu9250(IMU, lambda _: bus),
            zed=zed_of(world, RealClock(), clock.zero_ns) if stereo else None,
        )
        info = information(world, clock.utc, car_rig(world), trial)
        recorder = Recorder(folder, info, streams, clock.utc, Limits(still_s=STILL_S))
        with recorder:
            ends_ns, told_s = clock.zero_ns + world.drive.end_ns, 0.0
            while (now_ns := time.monotonic_ns()) < ends_ns and not recorder.is_over():
                recorder.poll()
                done_s = max((now_ns - clock.zero_ns) * 1e-9, 0.0)
                advance(done_s - told_s)
                told_s = done_s
                time.sleep(POLL_S)
    return recorder.info
