from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_drives import METRES_PER_COUNT, Drive

from calibration.clocks.clock_fit import ClockFit, fit_clock
from calibration.clocks.errors import ClockError
from calibration.clocks.motion import CarMotion, FilmedMotion, counted_motion
from calibration.clocks.picture import write_join_picture

SEEDS = range(27)


def error_s(fit: ClockFit, drive: Drive) -> float:
    return fit.offset_s - drive.offset_at(fit.ref_ns)


def refusal(motions: Sequence[tuple[CarMotion, FilmedMotion]]) -> str:
    """Why the motions are refused, whether the search or the fit does it; "" where they are not."""
    try:
        return "\n".join(fit_clock(motions).reasons)
    except ClockError as err:
        return str(err)


def test_the_offset_is_right_to_a_millisecond_and_its_sigma_is_honest() -> None:
    errors, standardised = [], []
    for seed in SEEDS:
        drive = Drive(seed=seed)
        fit = fit_clock([drive.gyro(), drive.wheels()])
        assert fit.good, fit.reasons
        assert fit.agree
        errors.append(error_s(fit, drive))
        standardised.append(errors[-1] / fit.sigma_offset_s)
        assert abs(fit.skew - drive.skew) < 4.0 * fit.sigma_skew
    assert np.abs(errors).max() < 1e-3
    chi_square = float(np.sum(np.square(standardised)))
    # 99.9 % of the chi-square distribution with 27 degrees of freedom lie between 9.1 and 57.
    assert 9.0 < chi_square < 57.0
    assert np.abs(standardised).max() < 4.0


def test_wheels_alone_tell_the_clocks_less_well_and_say_so() -> None:
    errors, sigmas = [], []
    for seed in SEEDS:
        drive = Drive(seed=seed)
        fit = fit_clock([drive.wheels()])
        errors.append(error_s(fit, drive))
        sigmas.append(fit.sigma_offset_s)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5e-3
    assert np.abs(np.divide(errors, sigmas)).max() < 4.0
    assert min(sigmas) > 0.95e-3


def test_counts_of_unknown_length_do_as_well() -> None:
    drive = Drive(seed=4)
    film = drive.wheels()[1]
    fit = fit_clock([(counted_motion(drive.vesc(), None), film)])
    assert abs(error_s(fit, drive)) < 4.0 * fit.sigma_offset_s
    assert fit.sources[0].fit is not None
    assert fit.sources[0].fit.scale[0] == pytest.approx(METRES_PER_COUNT, rel=0.06)


@pytest.mark.parametrize("offset_s", [86_400.0 + 1.7, -3.2e7, 1.0e9])
def test_clocks_days_and_years_apart_are_found(offset_s: float) -> None:
    drive = Drive(seed=5, offset_s=offset_s)
    fit = fit_clock([drive.gyro(), drive.wheels()])
    assert fit.good
    assert abs(error_s(fit, drive)) < 1e-3


def test_a_slow_film_in_which_the_car_is_hard_to_see_makes_sigma_grow() -> None:
    sharp, blurred = Drive(seed=6), Drive(seed=6, heading_sigma_rad=math.radians(0.5), film_hz=15.0)
    fits = [fit_clock([drive.gyro()]) for drive in (sharp, blurred)]
    assert fits[1].sigma_offset_s > 5.0 * fits[0].sigma_offset_s
    assert abs(error_s(fits[1], blurred)) < 3.0 * fits[1].sigma_offset_s


def test_gaps_of_the_gyro_cost_no_accuracy() -> None:
    drive = Drive(seed=8)
    car, film = drive.gyro()
    kept = np.ones(car.t_ns.size, bool)
    kept[900:960] = False
    # What was turned in the gap is not known either: the level jumps.
    level = car.level.copy()
    level[960:] += 0.3
    torn = replace(car, t_ns=car.t_ns[kept], level=level[kept], rate=car.rate[kept])
    fit = fit_clock([(torn, film)])
    assert fit.good
    assert abs(error_s(fit, drive)) < 1e-3


@pytest.mark.parametrize(
    ("kind", "turned", "drove"),
    [("straight", "hardly turned", "hardly changed its speed"), ("stands", "hardly", "hardly")],
)
def test_a_motion_that_excites_nothing_is_refused_with_what_to_do(
    kind: str, turned: str, drove: str
) -> None:
    drive = Drive(kind=kind)
    with pytest.raises(ClockError) as caught:
        fit_clock([drive.gyro(), drive.wheels()])
    text = str(caught.value)
    assert f"gyro: the filmed car {turned}" in text
    assert f"wheels: the filmed car {drove}" in text
    assert "begin and end each run with a figure of eight" in text


@pytest.mark.parametrize(("seed", "other"), [(1, 2), (3, 4), (5, 6), (7, 8), (9, 10)])
def test_the_film_of_another_run_is_refused(seed: int, other: int) -> None:
    car, film = Drive(seed=seed), Drive(seed=other)
    motions = [(car.gyro()[0], film.gyro()[1]), (car.wheels()[0], film.wheels()[1])]
    assert "the film of this run?" in refusal(motions) or "another run" in refusal(motions)


def test_a_course_that_repeats_itself_is_refused() -> None:
    drive = Drive(seed=1)
    car, film = drive.gyro()
    # Ten equal waves filmed in part: each of them fits as well.
    t_s = (car.t_ns - car.t_ns[0]) * 1e-9
    waves = replace(car, level=np.cos(2.0 * t_s), rate=-2.0 * np.sin(2.0 * t_s))
    part = np.flatnonzero((film.t_ns > car.t_ns[600]) & (film.t_ns < car.t_ns[1800]))
    at_s = (film.t_ns[part] - car.t_ns[0]) * 1e-9
    filmed = replace(film, t_ns=film.t_ns[part], level=np.cos(2.0 * at_s), sigma=film.sigma[part])
    with pytest.raises(ClockError, match="no offset stands out"):
        fit_clock([(waves, filmed)])


def test_a_gyro_of_the_other_sign_is_told() -> None:
    drive = Drive(seed=2)
    car, film = drive.gyro()
    upside_down = replace(car, level=-car.level, rate=-car.rate)
    with pytest.raises(ClockError, match=r"opposite sign.*z of the IMU must point up"):
        fit_clock([(upside_down, film)])
    with_wheels = fit_clock([(upside_down, film), drive.wheels()])
    assert "z of the IMU must point up" in with_wheels.reasons[0]


def test_gyro_and_wheels_that_contradict_each_other_are_refused() -> None:
    drive = Drive(seed=3)
    wheels, film = drive.wheels()
    late = replace(wheels, t_ns=wheels.t_ns + 20_000_000)
    fit = fit_clock([drive.gyro(), (late, film)])
    assert not fit.agree
    assert "gyro and wheels are" in fit.reasons[0]
    assert fit_clock([drive.gyro(), drive.wheels()]).agree


def test_wheels_that_slide_do_not_spoil_what_the_gyro_knows() -> None:
    drive = Drive(seed=3)
    wheels, film = drive.wheels()
    # Half a metre more than the car went, within a second and a half.
    t_s = (wheels.t_ns - wheels.t_ns[0]) * 1e-9
    slid = wheels.level + 0.5 * np.clip((t_s - 5.0) / 1.5, 0.0, 1.0)
    fit = fit_clock([drive.gyro(), (replace(wheels, level=slid), film)])
    assert fit.good
    assert fit.agree is None
    assert "not used, wheels: what is left" in fit.remarks[0]
    assert abs(error_s(fit, drive)) < 1e-3
    alone = refusal([(replace(wheels, level=slid), film)])
    assert "did they slide, or is it another run?" in alone


def test_an_offset_that_is_not_known_well_enough_is_refused() -> None:
    drive = Drive(seed=11, heading_sigma_rad=math.radians(1.5), film_hz=10.0)
    assert "at most 2 ms are needed" in refusal([drive.gyro()])


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    drive = Drive(seed=3)
    file = tmp_path / "join.png"
    write_join_picture(file, fit_clock([drive.gyro(), drive.wheels()]), "a drive")
    assert file.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 50_000
