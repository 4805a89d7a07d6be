"""`rig.yaml`: what is plugged in where, and how it shall be read."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from capture.configuration import read_configuration
from capture.errors import ConfigurationError
from capture.network_clock import host_and_port
from drivers.camera import ImageFolderConfig, VideoFileConfig
from drivers.camera.v4l2 import V4l2Config
from drivers.camera.zed import ZedConfig
from drivers.imu.mpu9250 import Mpu9250Config
from drivers.imu.razor import RazorConfig
from drivers.rplidar import RPLidarConfig
from drivers.vesc import VescCalibration, VescConfig

FORMAT = 1
RIG_NAME = "rig.yaml"


@dataclass(frozen=True, kw_only=True)
class RecordingConfig:
    """How a recording is made.

    folder : where sessions go; disk_reserve_mb : the recording ends when less is left;
    still_s : how long the car is asked to stand at the start, for the bias of the gyro;
    calibration_folder : the newest accepted calibration of each kind in it is copied into every
    session.
    clock_server : HOST[:PORT] where `trackside clock serve` runs, whose clock is asked at the start
    and at the end. Raises `ValueError` where that is none.
    """

    folder: str = "sessions"
    disk_reserve_mb: int = field(default=500, metadata={"min": 0})
    still_s: float = field(default=2.0, metadata={"min": 0.0, "max": 60.0})
    calibration_folder: str = "calibration"
    clock_server: str = ""

    def __post_init__(self) -> None:
        host_and_port(self.clock_server)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Every device of the car and of the track; those that are not named are not there.

    vesc_calibration : makes odometry of the VESC's counts; overhead_images, overhead_video : old
    footage in the place of the overhead camera. Raises `ValueError` for two of one kind.
    """

    format: int = FORMAT
    recording: RecordingConfig = RecordingConfig()
    lidar: RPLidarConfig | None = None
    vesc: VescConfig | None = None
    vesc_calibration: VescCalibration | None = None
    mpu9250: Mpu9250Config | None = None
    razor: RazorConfig | None = None
    zed: ZedConfig | None = None
    overhead: V4l2Config | None = None
    overhead_images: ImageFolderConfig | None = None
    overhead_video: VideoFileConfig | None = None

    def __post_init__(self) -> None:
        if self.format != FORMAT:
            raise ValueError(f"format {self.format} is not known; this trackside reads {FORMAT}")
        if self.mpu9250 is not None and self.razor is not None:
            raise ValueError("mpu9250 and razor would both be /imu/data_raw; keep one of them")
        overheads = (self.overhead, self.overhead_images, self.overhead_video)
        if sum(config is not None for config in overheads) > 1:
            raise ValueError(
                "overhead, overhead_images and overhead_video stand for one camera; keep one"
            )

    def has(self, name: str) -> bool:
        """Whether there is a device of that name; old footage counts as the overhead camera."""
        names = ("overhead", "overhead_images", "overhead_video") if name == "overhead" else (name,)
        return any(getattr(self, one) is not None for one in names)


def read_rig(file: Path) -> Rig:
    """The rig of a file; raises `ConfigurationError` with every fault and its place."""
    if not file.exists():
        raise ConfigurationError(
            f"{file}: there is no such rig file; trackside devices -o {file} writes one from what "
            "is plugged in"
        )
    return read_configuration(Rig, file)
