"""What is calibrated of the car: parameters with their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from capture.calibrations.format import FORMAT, Rows, check_covariance, check_format
from capture.session_info import software
from geometry import Floats


@dataclass(frozen=True)
class Parameter:
    """One number that was calibrated; its name tells the unit.

    sigma : standard deviation, None where nothing is claimed. source : "data", or in words what
    else it rests on (a tape measure, a prior, the rig).
    """

    name: str
    value: float
    sigma: float | None = None
    source: str = "data"


@dataclass(frozen=True, kw_only=True)
class MeasuredCalibration:
    """The content of `odometry_DATE.yaml`, `imu_DATE.yaml`, `lidar_DATE.yaml`, `markers_DATE.yaml`.

    covariance : of the first parameters, in their order, as many as it has rows; residuals : what
    was left over, names with units; how : sources, options, limits. Raises `ValueError` for another
    format or a covariance that does not fit.
    """

    format: int = FORMAT
    kind: Literal["odometry", "imu", "lidar", "markers"]
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...]
    covariance: Rows = ()
    residuals: Mapping[str, float] = field(default_factory=dict)
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        check_format(self.format)
        check_covariance(self.covariance, min(len(self.covariance), len(self.parameters)))

    def value(self, name: str) -> float | None:
        """The value of a parameter, None where it was not calibrated."""
        return next((one.value for one in self.parameters if one.name == name), None)

    @cached_property
    def correlation(self) -> Floats:
        """(k, k) of the parameters that `covariance` is of."""
        covariance = np.array(self.covariance).reshape(len(self.covariance), len(self.covariance))
        sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        return np.asarray(covariance / np.outer(sigma, sigma))
