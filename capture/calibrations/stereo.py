"""The two eyes on the car."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from capture.calibrations.format import FORMAT, Rows, check_format
from capture.calibrations.overhead import ViewResidual
from capture.session_info import software
from geometry import Camera, Mounting, StereoPair


@dataclass(frozen=True, kw_only=True)
class StereoCalibration:
    """The content of `stereo_DATE.yaml`: two eyes, and where the left one sits on the car.

    rotation, translation_m : x_right = R x_left + t in a camera's axes (right, down, ahead).
    rotation_sigma_rad, translation_sigma_m : standard deviations (3,); rms_px : of the board's
    points; epipolar_rms_px : how far the two images of a point are from one row, rectified. These
    are None where a factory did not tell them.
    """

    format: int = FORMAT
    kind: Literal["stereo"] = "stereo"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    left: Camera
    right: Camera
    rotation: Rows
    translation_m: tuple[float, ...]
    mounting: Mounting = field(default_factory=Mounting)
    rotation_sigma_rad: tuple[float, ...] | None = None
    translation_sigma_m: tuple[float, ...] | None = None
    rms_px: float | None = None
    epipolar_rms_px: float | None = None
    views: tuple[ViewResidual, ...] = ()
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        check_format(self.format)
        _ = self.pair  # its own checks: a rotation, the right eye to the right

    @classmethod
    def of_pair(
        cls,
        pair: StereoPair,
        mounting: Mounting,
        *,
        made_utc: str,
        how: Mapping[str, object],
    ) -> StereoCalibration:
        """That of a pair which is known, and so accepted."""
        return cls(
            made_utc=made_utc,
            accepted=True,
            left=pair.left,
            right=pair.right,
            rotation=tuple(tuple(row) for row in pair.rotation.tolist()),
            translation_m=tuple(pair.translation.tolist()),
            mounting=mounting,
            how=how,
        )

    @cached_property
    def pair(self) -> StereoPair:
        """The two eyes."""
        return StereoPair(
            self.left, self.right, np.array(self.rotation), np.array(self.translation_m)
        )
