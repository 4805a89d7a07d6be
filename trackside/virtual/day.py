"""One run of a virtual track day as a folder: the car's recording, the film, the exact truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Protocol, cast

from capture import (
    Session,
    SessionInfo,
    calibration_file,
    new_folder,
    write_calibration,
    write_yaml,
)
from capture.result_files import write_ground_truth
from capture.yaml_file import plain
from dialogue import TracksideError
from simulation.build import AS_BUILT
from simulation.overhead_film import hung_view
from simulation.real_time import real_time_clock, record_car_in_real_time
from simulation.recordings import CarClock, exact_truth, record_car, record_film
from simulation.stereo import told_calibration
from simulation.world import World, world
from tracking.scene import CarRings, ConeRings, Scene
from trackside.virtual.car_calibrations import car_calibrations
from trackside.virtual.morning import BOARD_VIEWS, FLOOR_PICTURES, calibrated_site

ON_CAR, BESIDE_TRACK = ("stereo", "odometry", "lidar", "imu", "markers"), ("camera", "world")
"""Kinds of calibrations that each machine's session carries."""
COMMANDED = ("figures",)
"""Maps that are driven through the motor controller, so that its steering is on record."""
CAR, FILM, TRUTH, CALIBRATION, SCENE = "car", "film", "truth", "calibration", "scene.yaml"


class Steps(Protocol):
    """Shows the work: a label and how many steps it has; the context counts them."""

    def __call__(self, label: str, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """A context that gives the function which is told how many steps were done."""


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """What to drive and what to keep of it.

    site : a folder with calibrations made before, None: the camera is calibrated anew; filmed :
    without a film the exact truth becomes the ground truth of the car's session; realtime : the
    car's devices live at real pace behind pseudo-terminals, else in simulated time;
    stereo : with the ZED; jobs : 2 films in a process of its own.
    """

    map: str
    power: str
    seed: int
    trial: int | None = None
    site: Path | None = None
    filmed: bool = True
    realtime: bool = False
    stereo: bool = True
    jobs: int = 1


def simulate_run(folder: Path, plan: RunPlan, steps: Steps) -> None:
    """Make `folder` with `car/`, `film/`, `truth/`, `calibration/` and `scene.yaml`, or nothing.

    Raises `SessionError` where it exists, `UsageError` for a map or power that is none.
    """
    made = world(plan.map, plan.power, plan.seed)
    if plan.filmed and plan.site is not None:
        for kind in BESIDE_TRACK:
            calibration_file(plan.site, kind)  # which tells what is missing
    with new_folder(folder) as partial:
        (partial / CAR).mkdir()
        with filming(partial, plan) as film:
            _calibrations(partial / CALIBRATION, plan, steps)
            clock = _car(partial, made, plan, steps)
            truth = exact_truth(made, clock)
            write_ground_truth(partial / TRUTH, truth)
            if not plan.filmed:
                Session.open(partial / CAR).write_ground_truth(truth)
                return
            write_yaml(partial / SCENE, cast("dict[str, object]", plain(scene_of(made))))
            film(made, clock, steps)
        _keep(partial, FILM, BESIDE_TRACK)


def simulate_site(folder: Path, steps: Steps) -> None:
    """Make `folder` with the calibrations of the site, for the `site` of runs."""
    with new_folder(folder) as partial:
        _calibrate_car(partial)
        _calibrate_camera(partial, steps)


def scene_of(made: World) -> Scene:
    """What a person measures with a ruler: rings on the car as it is drawn, and on the cones."""
    rings = made.drawn.rings
    return Scene(
        car=CarRings(front_x_m=rings.front_x_m, rear_x_m=rings.rear_x_m, height_m=rings.height_m),
        cones=ConeRings(height_m=made.room.cone.top_m),
    )


def _calibrations(folder: Path, plan: RunPlan, steps: Steps) -> None:
    folder.mkdir()
    if plan.site is None:
        # A car that drives figures is to be calibrated by them.
        _calibrate_car(folder, calibrated=plan.map not in COMMANDED)
        if plan.filmed:
            _calibrate_camera(folder, steps)
        return
    for file in sorted(plan.site.glob("*.yaml")):
        (folder / file.name).write_bytes(file.read_bytes())


def _calibrate_car(folder: Path, *, calibrated: bool = True) -> None:
    """What the car brings along: the factory's file of its ZED, and what was calibrated."""
    write_calibration(folder, told_calibration())
    if calibrated:
        for one in car_calibrations(AS_BUILT):
            write_calibration(folder, one)


def _calibrate_camera(folder: Path, steps: Steps) -> None:
    with steps("calibrating the camera", BOARD_VIEWS + FLOOR_PICTURES) as advance:
        calibrated_site(folder, hung_view(), advance)


def _car(partial: Path, made: World, plan: RunPlan, steps: Steps) -> CarClock:
    seconds = made.drive.end_ns // 1_000_000_000
    with steps("recording the car", seconds) as advance:
        clock = real_time_clock() if plan.realtime else CarClock()
        record = record_car_in_real_time if plan.realtime else record_car
        info = record(
            made,
            partial / CAR,
            trial=plan.trial,
            commanded=plan.map in COMMANDED,
            stereo=plan.stereo,
            clock=clock,
            advance=whole(advance),
        )
    _refuse_bad(info, CAR, plan)
    _keep(partial, CAR, [kind for kind in ON_CAR if plan.stereo or kind != "stereo"])
    return clock


@contextmanager
def filming(partial: Path, plan: RunPlan) -> Iterator[Callable[[World, CarClock, Steps], None]]:
    """A block in which the film is made, in a process beside this one if the plan has two.

    Gives what makes it or waits for it. At real pace the film needs the clock of the car first.
    """
    if not plan.filmed:
        yield lambda _made, _clock, _steps: None
        return
    (partial / FILM).mkdir()
    if plan.jobs == 1 or plan.realtime:
        yield lambda made, clock, steps: _film(partial / FILM, made, plan, clock, steps)
        return
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as beside:
        made = beside.submit(_film_beside, partial / FILM, plan)
        yield lambda _made, _clock, _steps: made.result()


def _film_beside(folder: Path, plan: RunPlan) -> None:
    made = world(plan.map, plan.power, plan.seed)
    _film(folder, made, plan, CarClock(), _silent)


@contextmanager
def _silent(label: str, total: int) -> Iterator[Callable[[int], None]]:
    del label, total  # nobody looks at a process beside this one
    yield lambda _done: None


def _film(folder: Path, made: World, plan: RunPlan, clock: CarClock, steps: Steps) -> None:
    seconds = made.drive.end_ns // 1_000_000_000 + 1
    with steps("filming", seconds) as advance:
        told = record_film(
            made, hung_view(), folder, trial=plan.trial, car=clock, advance=whole(advance)
        )
    _refuse_bad(told, FILM, plan)


def _keep(partial: Path, name: str, kinds: Sequence[str]) -> None:
    """Copy the calibrations in force into a session."""
    session = Session.open(partial / name)
    for kind in kinds:
        for file in sorted((partial / CALIBRATION).glob(f"{kind}_*.yaml"))[-1:]:
            session.copy_calibration(file)


def whole(advance: Callable[[int], None]) -> Callable[[float], None]:
    """What takes parts of steps and hands on whole ones."""
    done = 0.0

    def take(part: float) -> None:
        nonlocal done
        before, done = int(done), done + part
        if int(done) > before:
            advance(int(done) - before)

    return take


def _refuse_bad(told: SessionInfo, name: str, plan: RunPlan) -> None:
    if told.verdict == "good":
        return
    if plan.realtime:
        advice = "this machine was too busy to record at real pace; leave out --realtime"
    else:
        advice = "a fault of trackside; please report it with map, power and seed"
    raise TracksideError(
        f"the simulated recording {name} came out bad ({told.verdict_reason}): {advice}"
    )
