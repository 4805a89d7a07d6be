"""From two sessions to one: the motions to compare, the clocks, the session that is written."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from calibration.clocks.clock_fit import MOST_SIGMA_S, ClockFit, fit_clock
from calibration.clocks.errors import ClockError
from calibration.clocks.motion import (
    CarMotion,
    FilmedMotion,
    counted_motion,
    filmed_distance,
    filmed_heading,
    gyro_motion,
    odometry_motion,
)
from calibration.clocks.network import (
    Comparison,
    NetworkOffset,
    compared,
    disagreement,
    network_offset,
)
from calibration.clocks.picture import write_join_picture
from calibration.clocks.record import fit_record
from capture import (
    CameraDelayCalibration,
    FilmClock,
    GroundTruth,
    MissingStreamError,
    PeerClock,
    Session,
    accepted_file,
    keep_pictures,
    mapped_truth,
    new_joined_session,
    read_camera_delay,
    write_yaml,
)
from tracking import Film, Scene, TrackResult, summary, write_pictures

WHEELS = ("vesc", "wheel")
"""Odometry that counts wheels."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """A film that was tracked just now, and with what."""

    film: Film
    result: TrackResult
    world_file: Path
    scene: Scene

    @property
    def summary(self) -> tuple[str, ...]:
        """What `trackside track` says of it."""
        return summary(self.result)


@dataclass(frozen=True, eq=False)
class Joining:
    """The clocks of two sessions by the data, by the network, and how these compare.

    trust_data : a network that contradicts is a remark only.
    """

    fit: ClockFit
    network: NetworkOffset | None
    comparison: Comparison | None
    notes: tuple[str, ...] = ()
    trust_data: bool = False

    @property
    def reasons(self) -> tuple[str, ...]:
        """Everything that speaks against joining."""
        return self.fit.reasons if self.trust_data else (*self.fit.reasons, *self._contradiction)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is worth knowing all the same."""
        return (*self.notes, *self._contradiction) if self.trust_data else self.notes

    @property
    def _contradiction(self) -> tuple[str, ...]:
        if self.network is None or self.comparison is None or self.comparison.agrees:
            return ()
        return (disagreement(self.fit, self.network, self.comparison),)

    @property
    def lines(self) -> tuple[str, ...]:
        """What a table of it says below: comparisons and the verdict."""
        told = []
        if self.fit.apart_s is not None:
            apart, limit = self.fit.apart_s
            told.append(
                f"gyro and wheels {1e3 * apart:.2f} ms apart, {1e3 * limit:.1f} are allowed"
            )
        if self.comparison is not None:
            of = "calibrated" if self.comparison.known else "not calibrated"
            told.append(
                f"data minus network {1e3 * self.comparison.apart_s:+.2f} ms, camera's delay {of} "
                f"({1e3 * self.comparison.delay_s:+.2f} ms), {1e3 * self.comparison.limit_s:.1f} "
                "around it are allowed"
            )
        else:
            told.append("network: nothing was said")
        return (*told, "verdict: " + ("bad" if self.reasons else "good"))

    def check(self) -> None:
        """Raise `ClockError` with every reason why the two cannot be joined."""
        if self.reasons:
            raise ClockError("\n".join(["cannot join:", *(f"  {text}" for text in self.reasons)]))

    def film_clock(self) -> FilmClock:
        """What the joined session keeps of it."""
        clock = self.fit.film_clock()
        if self.network is None:
            return clock
        return replace(
            clock,
            network_offset_ns=self.network.offset_ns,
            network_sigma_ns=round(self.network.sigma_s * 1e9),
        )


def motions_of(
    car: Session, truth: GroundTruth, without: str | None = None
) -> list[tuple[CarMotion, FilmedMotion]]:
    """What the car's sensors and the film both tell; raises `ClockError` where nothing is left."""
    found: list[tuple[CarMotion, FilmedMotion]] = []
    if without != "gyro":
        with suppress(MissingStreamError):
            found.append((gyro_motion(car.imu()), filmed_heading(truth)))
    wheels = None if without == "wheels" else _wheels(car)
    if wheels is not None:
        found.append((wheels, filmed_distance(truth)))
    if not found:
        raise ClockError(
            f"{car.folder}: has neither a gyro nor wheel counts to compare the film with; record "
            "the IMU or the motor controller"
        )
    return found


def clock_of(
    car: Session,
    film: Session,
    motions: Sequence[tuple[CarMotion, FilmedMotion]],
    peers: Sequence[PeerClock] = (),
    place: Path | None = None,
    *,
    trust_data: bool = False,
    most_sigma_s: float = MOST_SIGMA_S,
) -> Joining:
    """The clocks of two sessions.

    peers : besides what the recorder of the car was told; place : where a calibration of the
    camera's delay may be. Raises `ClockError`.
    """
    fit = fit_clock(motions, most_sigma_s)
    peers = (*car.info.peer_clocks, *film.info.peer_clocks, *peers)
    network, remarks = network_offset(car.info, film.info, peers, fit.ref_ns)
    comparison = None if network is None else compared(fit, network, _delay(film, place))
    notes = (*_told_apart(car, film), *fit.remarks, *remarks)
    return Joining(fit, network, comparison, notes, trust_data)


def write_joined(
    target: Path,
    car: Session,
    film: Session,
    truth: GroundTruth,
    joining: Joining,
    tracked: Tracked | None,
    *,
    clip: bool,
) -> None:
    """The joined session with its truth and its pictures; whole or not at all.

    truth : on the film's clock; tracked : the film it was made of just now, None for a truth that
    the film had.
    """
    clock = joining.film_clock()
    with new_joined_session(target, car, film, clock) as made:
        made.write_ground_truth(mapped_truth(truth, clock))
        if tracked is None:
            keep_pictures(film, made)
        else:
            made.adopt_calibrations([tracked.world_file])
            folder = made.folder / "ground_truth"
            write_pictures(
                folder, tracked.film, tracked.result, tracked.world_file, tracked.scene, clip=clip
            )
        record = fit_record(joining.fit, joining.network, joining.comparison)
        write_yaml(made.folder / "join.yaml", record)
        write_join_picture(made.folder / "join.png", joining.fit, f"{car.name} and {film.name}")


def _told_apart(car: Session, film: Session) -> tuple[str, ...]:
    """What the two sessions say of themselves that should make one look twice."""
    notes = [
        f"{name}: the car's session says {mine!r}, the film's {theirs!r}"
        for name in ("map", "power", "trial")
        for mine, theirs in [(getattr(car.info, name), getattr(film.info, name))]
        if mine and theirs and mine != theirs
    ]
    notes += [
        f"the recording of {one.name} is bad: {one.info.verdict_reason}"
        for one in (car, film)
        if one.info.verdict == "bad"
    ]
    return tuple(notes)


def _wheels(car: Session) -> CarMotion | None:
    """The counts themselves; else the distance of an odometry that was made of such."""
    calibration = car.motor_calibration()
    per_count = None if calibration is None else calibration.metres_per_count
    with suppress(MissingStreamError):
        return counted_motion(car.vesc_state(), per_count)
    source = next((name for name in car.odometry_sources if name in WHEELS), None)
    return None if source is None else odometry_motion(car.odometry(source))


def _delay(film: Session, place: Path | None) -> CameraDelayCalibration | None:
    """The camera's delay in force: of the place that was told, of the film's session, of here."""
    folders = [film.folder / "calibration", Path("calibration")]
    if place is not None:
        folders.insert(0, place.parent if place.is_file() else place)
    for folder in folders:
        file = accepted_file(folder, "camera-delay")
        if file is not None:
            return read_camera_delay(file)
    return None
