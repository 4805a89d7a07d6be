"""Whether a ground truth can be trusted, and everything that speaks against it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats
from tracking.following import Tracks
from tracking.scene import Scene
from tracking.watching import Watch

LEAST_COVERAGE = 0.9
MOST_GAP_S = 1.0
MOST_DAMAGED = 0.02
SPAN_OFF_M = 0.005


@dataclass(frozen=True)
class Judgement:
    """reasons : what makes the truth bad; remarks : what is only worth knowing.

    coverage : share of frames, damaged ones included, between first and last sight in which the
    car was seen.
    """

    good: bool
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]
    frames: int
    damaged: int
    coverage: float
    longest_gap_s: float
    bridged: int
    residual_px: float
    standing_px: float
    span_mean_m: float
    span_rms_m: float

    def record(self) -> dict[str, object]:
        """For `ground_truth.yaml`; what is not known is None."""
        return {
            "verdict": "good" if self.good else "bad",
            "reasons": self.reasons,
            "remarks": self.remarks,
            "frames": self.frames,
            "damaged_frames": self.damaged,
            "coverage": self.coverage,
            "longest_gap_s": self.longest_gap_s,
            "bridged_poses": self.bridged,
            "car_residual_px": _known(self.residual_px),
            "standing_residual_px": _known(self.standing_px),
            "car_rings_apart_m": self.span_mean_m,
            "car_rings_apart_rms_m": self.span_rms_m,
        }


def judged(
    tracks: Tracks,
    seen: Watch,
    bridged: npt.NDArray[np.bool_],
    rows: npt.NDArray[np.int64],
    span_m: Floats,
    scene: Scene,
    remarks: tuple[str, ...],
) -> Judgement:
    """The verdict on a run; rows are the frames of its poses."""
    both = np.flatnonzero(tracks.seen[:, -2:].all(axis=1))
    gap_s = float(np.diff(tracks.t_ns[both]).max(initial=0)) * 1e-9
    within = tracks.sequence[both[-1]] - tracks.sequence[both[0]] + 1
    coverage = float(both.size / max(int(within), 1))
    torn = sum(fault.startswith("torn") for _, fault in tracks.faults)
    total = len(tracks.t_ns) + len(tracks.faults) - torn
    off_m = float(span_m.mean()) - scene.car.span_m
    start_ns = int(tracks.t_ns[0])
    reasons = [
        *_camera_reasons(seen, start_ns),
        *(
            f"{bump.name} was bumped {(bump.t_ns - start_ns) * 1e-9:.1f} s after the start and "
            f"stands {1e3 * bump.moved_m:.0f} mm off: its place holds for the time before only"
            for bump in seen.bumps
        ),
    ]
    if coverage < LEAST_COVERAGE:
        reasons.append(
            f"the car was seen in {100 * coverage:.1f} % of the frames, at least "
            f"{100 * LEAST_COVERAGE:.0f} % are needed: shadows, exposure, something in the way?"
        )
    if gap_s > MOST_GAP_S:
        reasons.append(f"nobody saw the car for {gap_s:.2f} s, at most {MOST_GAP_S} s")
    if len(tracks.faults) > MOST_DAMAGED * total:
        reasons.append(f"{len(tracks.faults)} of {total} frames could not be used")
    if abs(off_m) > SPAN_OFF_M:
        reasons.append(
            f"the car's rings come out {1e3 * (off_m + scene.car.span_m):.1f} mm apart, "
            f"{1e3 * scene.car.span_m:.1f} mm were told: height_m or the lever arms are wrong"
        )
    return Judgement(
        good=not reasons,
        reasons=tuple(reasons),
        remarks=(*remarks, *_remarks(tracks, seen)),
        frames=total,
        damaged=len(tracks.faults),
        coverage=coverage,
        longest_gap_s=gap_s,
        bridged=int(bridged[: rows.size].sum()),
        residual_px=float(np.nanmedian(tracks.scatter_px[both, -2:])),
        standing_px=seen.residual_px,
        span_mean_m=float(span_m.mean()),
        span_rms_m=float(span_m.std()),
    )


def _camera_reasons(seen: Watch, start_ns: int) -> list[str]:
    if seen.moved_ns is None:
        return []
    after_s = (seen.moved_ns - start_ns) * 1e-9
    return [
        f"the camera moved {after_s:.1f} s after the start, by up to {seen.moved_px:.1f} px: what "
        "follows is wrong by as much; fix the camera, calibrate and film again"
    ]


def _remarks(tracks: Tracks, seen: Watch) -> list[str]:
    remarks = []
    faults = Counter(fault.partition(":")[0] for _, fault in tracks.faults)
    for fault, count in sorted(faults.items()):
        where = ", ".join(str(n) for n, text in tracks.faults if text.startswith(fault))
        short = where if len(where) < 60 else f"{where[:60]}..."
        remarks.append(f"{count} frames left out, {fault}: {short}")
    if seen.watched < 0.5 * len(tracks.t_ns):
        remarks.append(
            "in less than half of the frames three rings that stand were in sight: whether the "
            "camera moved is not known"
        )
    if seen.hidden:
        remarks.append(f"hardly ever in sight during the run: {', '.join(seen.hidden)}")
    if tracks.unsettled:
        remarks.append(
            f"in {len(tracks.unsettled)} stretches the car hardly moved, so that front and rear "
            "were not settled there; give start_heading_deg"
        )
    if tracks.stretch.max(initial=0) > 0:
        remarks.append(
            f"the car was lost and found again {int(tracks.stretch.max())} times without knowing "
            "which way it points; each time its driving settled it"
        )
    return remarks


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None
