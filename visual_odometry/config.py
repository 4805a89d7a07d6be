"""How visual odometry looks, and when it says that it is lost."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class VoConfig:
    """Parameters of visual odometry; pixels are those of a rectified eye."""

    cells_across: int = field(default=16, metadata={"min": 1})
    cells_down: int = field(default=9, metadata={"min": 1})
    per_cell: int = field(default=3, metadata={"min": 1})
    """Most corners in each cell of a key frame."""
    closing_px: float = field(default=1.0, metadata={"min": 0.0})
    """How far the way over both eyes and back may miss its start."""
    row_px: float = field(default=1.0, metadata={"min": 0.0})
    """How far the two images of a point may be from one row."""
    least_disparity_px: float = field(default=3.0, metadata={"min": 0.0})
    """What is farther away tells no distance, and little motion."""
    least_likeness: float = field(default=0.8, metadata={"min": 0.0, "max": 1.0})
    """Normalised correlation of a patch with what it was in the key frame."""
    ransac_px: float = field(default=2.0, metadata={"min": 0.0})
    pixel_sigma_px: float = field(default=0.1, metadata={"min": 0.001})
    """Of a matched point, to begin with; each frame's residuals then tell it anew."""
    least_inliers: int = field(default=20, metadata={"min": 6})
    least_inlier_share: float = field(default=0.4, metadata={"min": 0.0, "max": 1.0})
    key_frame_m: float = field(default=0.1, metadata={"min": 0.0})
    key_frame_deg: float = field(default=3.0, metadata={"min": 0.0})
    key_frame_share: float = field(default=0.5, metadata={"min": 0.0, "max": 1.0})
    """A new key frame after so much motion, or when fewer of its points are still seen."""
    max_speed_m_s: float = field(default=10.0, metadata={"min": 0.0})
    max_yaw_rate_rad_s: float = field(default=10.0, metadata={"min": 0.0})
    max_tilt_deg: float = field(default=6.0, metadata={"min": 0.0})
    """How far the body may pitch or roll between two key frames."""
    patience_s: float = field(default=0.5, metadata={"min": 0.0})
    """For how long after the last good frame the key frame is still looked for."""
    covariance_factor: float = field(default=1.0, metadata={"min": 0.0})
    """Of the predicted covariance; points of one surface err together, which no residual tells."""
