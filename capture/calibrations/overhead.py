"""What is calibrated of the overhead camera: its inside, its place above the floor, its delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from capture.calibrations.format import FORMAT, Rows, check_covariance, check_format
from capture.session_info import software
from geometry import Camera, Floats, RingShape, View


@dataclass(frozen=True, kw_only=True)
class ViewResidual:
    """One picture of a board: how many points it gave, how far off they were, whether it counts."""

    name: str
    points: int
    rms_px: float
    used: bool = True
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class CameraCalibration:
    """The content of `camera_DATE.yaml`.

    covariance : (9, 9) of fx, fy, cx, cy, k1, k2, p1, p2, k3. coverage : share of the picture in
    which there were points. how : board, source, options.
    """

    format: int = FORMAT
    kind: Literal["camera"] = "camera"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    camera: Camera
    covariance: Rows
    rms_px: float
    coverage: float
    views: tuple[ViewResidual, ...]
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        check_format(self.format)
        check_covariance(self.covariance, 9)

    @cached_property
    def covariance_matrix(self) -> Floats:
        """(9, 9)."""
        return np.array(self.covariance)


@dataclass(frozen=True, kw_only=True)
class PlacedMarker:
    """A ring of known place. corner : 1 to 4, or None.

    covariance_m2 : sxx, sxy, syy. residual_px : how far from there the camera saw it.
    """

    name: str
    xyz_m: tuple[float, float, float]
    covariance_m2: tuple[float, float, float]
    residual_px: float
    corner: int | None = None


@dataclass(frozen=True, kw_only=True)
class LengthResidual:
    """A length between two markers as it was measured, and how much longer the fit has it."""

    markers: tuple[str, ...]
    length_m: float
    sigma_m: float
    residual_m: float


@dataclass(frozen=True, kw_only=True)
class WorldCalibration:
    """The content of `world_DATE.yaml`: a camera in its place above the floor.

    camera : as adjusted together with the floor. rotation, translation_m : world into camera.
    covariance : (15, 15) of the camera's nine parameters, turn and translation
    (`geometry.uncertainty`). accuracy_m : predicted standard deviations, by height.
    """

    format: int = FORMAT
    kind: Literal["world"] = "world"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    camera: Camera
    rotation: Rows
    translation_m: tuple[float, float, float]
    covariance: Rows
    ring: RingShape
    markers: tuple[PlacedMarker, ...]
    lengths: tuple[LengthResidual, ...]
    accuracy_m: Mapping[str, float]
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        check_format(self.format)
        check_covariance(self.covariance, 15)

    @cached_property
    def view(self) -> View:
        """The camera in its place."""
        return View(self.camera, np.array(self.rotation), np.array(self.translation_m))

    @cached_property
    def covariance_matrix(self) -> Floats:
        """(15, 15)."""
        return np.array(self.covariance)


@dataclass(frozen=True, kw_only=True)
class DelayOfSession:
    """What one joined session tells of the camera's delay."""

    name: str
    delay_s: float
    sigma_s: float
    residual_s: float


@dataclass(frozen=True, kw_only=True)
class CameraDelayCalibration:
    """The content of `camera-delay_DATE.yaml`: by how much the overhead camera stamps wrong.

    delay_s : offset of the clocks by the data minus that by the network, car minus film; below 0
    where the camera's stamps are late (or the gyro's early). scatter_s : between the sessions.
    """

    format: int = FORMAT
    kind: Literal["camera-delay"] = "camera-delay"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    delay_s: float
    sigma_s: float
    scatter_s: float
    sessions: tuple[DelayOfSession, ...]
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        check_format(self.format)
