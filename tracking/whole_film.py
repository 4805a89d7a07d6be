"""What `trackside track` and `trackside join` both do around the tracking of a film."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from capture import read_world_calibration, write_text
from tracking.film import Film
from tracking.ground_truth import TrackResult
from tracking.preview import preview_picture, write_clip, write_picture
from tracking.scene import Scene, read_scene
from tracking.track_page import facts, track_page

USUAL_SCENE = Path("scene.yaml")


def scene_of(file: Path | None, start_heading_deg: float | None = None) -> tuple[Scene, str]:
    """The scene of a file, or of the usual one, or the usual scene; and which it is."""
    if file is None and USUAL_SCENE.exists():
        file = USUAL_SCENE
    scene = Scene() if file is None else read_scene(file)
    if start_heading_deg is not None:
        scene = replace(scene, start_heading_deg=start_heading_deg)
    return scene, f"{file or 'the usual one, no scene.yaml given'}"


def write_pictures(
    folder: Path, film: Film, result: TrackResult, world_file: Path, scene: Scene, *, clip: bool
) -> None:
    """`preview.png`, `track.html` and, as long as tracking took, `track.mp4`."""
    view = read_world_calibration(world_file).view
    picture = preview_picture(result, view, scene)
    write_picture(folder / "preview.png", picture)
    write_text(folder / "track.html", track_page(film.source, result, picture))
    if clip:
        write_clip(folder / "track.mp4", film, result, view, scene)


def summary(result: TrackResult) -> tuple[str, ...]:
    """Facts, verdict, what speaks against it; a line each."""
    judgement = result.judgement
    return (
        *(f"{name}: {value}" for name, value in facts(judgement)),
        f"cones: {len(result.truth.landmarks or ())}",
        "good" if judgement.good else "bad",
        *(f"  {line}" for line in judgement.reasons),
        *(f"  note: {line}" for line in judgement.remarks),
    )
