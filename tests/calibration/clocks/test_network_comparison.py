from __future__ import annotations

from dataclasses import replace

import pytest
from synthetic_drives import START_NS, Drive

from calibration.clocks.clock_fit import fit_clock
from calibration.clocks.network import NetworkOffset, compared, disagreement, network_offset
from capture import CameraDelayCalibration, ClockPair, PeerClock, SessionInfo

S = 1_000_000_000
CAR, LAPTOP = "11111111-1111-1111-1111-111111111111", "22222222-2222-2222-2222-222222222222"
OFFSET_NS = 437_100_000
"""Car time minus film time, of the sessions below."""


def sessions() -> tuple[SessionInfo, SessionInfo]:
    """The car began 50 s after its monotonic clock, the laptop 900 s after its own.

    At the same moment the UTC clock of the car shows OFFSET_NS more than that of the laptop.
    """
    car = SessionInfo(
        clocks=(ClockPair(monotonic_ns=50 * S, utc_ns=START_NS + OFFSET_NS),), boot_id=CAR
    )
    film = SessionInfo(clocks=(ClockPair(monotonic_ns=900 * S, utc_ns=START_NS),), boot_id=LAPTOP)
    return car, film


def asked_on_the_car(at_s: int, error_ns: int = 0, *, known: bool = True) -> PeerClock:
    """The laptop's clocks as the car sees them, so long after both began."""
    return PeerClock(
        peer="laptop:47123",
        monotonic_ns=(50 + at_s) * S,
        utc_ns=START_NS + OFFSET_NS + at_s * S,
        offset_monotonic_ns=850 * S + error_ns,
        offset_utc_ns=-OFFSET_NS + error_ns,
        uncertainty_ns=300_000,
        round_trip_ns=600_000,
        answers=90,
        boot_id=LAPTOP if known else "",
        own_boot_id=CAR if known else "",
    )


def test_what_the_car_was_told_gives_the_offset_of_the_sessions() -> None:
    found, remarks = network_offset(*sessions(), [asked_on_the_car(1)], START_NS + 10 * S)
    assert found is not None
    assert found.offset_ns == OFFSET_NS
    # Nine seconds further on, a skew of 50 ppm may have moved it.
    assert found.sigma_s == pytest.approx((0.3e-3**2 + (9 * 50e-6) ** 2) ** 0.5, rel=1e-3)
    assert remarks == ()


def test_a_clock_that_was_set_meanwhile_is_no_harm_where_the_machines_are_known() -> None:
    told = replace(asked_on_the_car(1), utc_ns=5, offset_utc_ns=7 * S)
    found, _ = network_offset(*sessions(), [told], START_NS)
    assert found is not None
    assert found.offset_ns == OFFSET_NS


def test_without_names_of_the_machines_utc_counts() -> None:
    told = replace(asked_on_the_car(1, known=False), offset_monotonic_ns=0)
    found, _ = network_offset(*sessions(), [told], START_NS)
    assert found is not None
    assert found.offset_ns == OFFSET_NS


def test_asking_from_the_laptop_is_the_same_the_other_way_round() -> None:
    one = asked_on_the_car(2)
    other = replace(
        one,
        monotonic_ns=one.monotonic_ns + one.offset_monotonic_ns,
        utc_ns=one.utc_ns + one.offset_utc_ns,
        offset_monotonic_ns=-one.offset_monotonic_ns,
        offset_utc_ns=-one.offset_utc_ns,
        boot_id=CAR,
        own_boot_id=LAPTOP,
    )
    found, _ = network_offset(*sessions(), [other], START_NS)
    assert found is not None
    assert found.offset_ns == OFFSET_NS


def test_two_askings_are_joined_by_a_line() -> None:
    # The laptop loses 100 us in 20 s.
    peers = [asked_on_the_car(0, 0), asked_on_the_car(20, -100_000)]
    peers = [replace(one, uncertainty_ns=2_000) for one in peers]
    found, _ = network_offset(*sessions(), peers, START_NS + 10 * S)
    assert found is not None
    assert found.offset_ns == pytest.approx(OFFSET_NS + 50_000, abs=2_000)
    assert found.sigma_s < 3e-6


def test_one_machine_needs_no_network() -> None:
    car, film = sessions()
    found, _ = network_offset(car, replace(film, boot_id=CAR), [], START_NS)
    assert found is not None
    assert found.offset_ns == OFFSET_NS + 850 * S
    assert found.method == "recorded on one machine"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"boot_id": CAR}, "not the machine that filmed, or was started anew"),
        ({"own_boot_id": "33333333-3333-3333-3333-333333333333"}, "not asked on the car"),
    ],
)
def test_what_another_machine_said_is_not_used(change: dict[str, str], why: str) -> None:
    told = replace(asked_on_the_car(1), **change)  # type: ignore[arg-type]  # names of its fields
    found, remarks = network_offset(*sessions(), [told], START_NS)
    assert found is None
    assert why in remarks[0]


def delay(delay_s: float) -> CameraDelayCalibration:
    return CameraDelayCalibration(
        made_utc="2026-05-14T10:00:00Z",
        accepted=True,
        delay_s=delay_s,
        sigma_s=5e-4,
        scatter_s=5e-4,
        sessions=(),
    )


def test_a_network_that_is_50_ms_off_is_refused_and_both_are_named() -> None:
    drive = Drive(seed=1)
    fit = fit_clock([drive.gyro()])
    right = NetworkOffset(fit.offset_ns + 3_000_000, 3e-4, "asked twice over the network")
    assert compared(fit, right, None).agrees
    wrong = NetworkOffset(fit.offset_ns - 50_000_000, 3e-4, "asked twice over the network")
    found = compared(fit, wrong, None)
    assert not found.agrees
    text = disagreement(fit, wrong, found)
    assert "the data say +0.437" in text
    assert "the network +0.387" in text
    assert "+50.0 ms apart" in text


def test_a_calibrated_delay_explains_what_is_apart_and_narrows_what_is_believed() -> None:
    drive = Drive(seed=1)
    fit = fit_clock([drive.gyro()])
    network = NetworkOffset(fit.offset_ns + 50_000_000, 3e-4, "asked")
    assert compared(fit, network, delay(-0.050)).agrees
    near = NetworkOffset(fit.offset_ns + 15_000_000, 3e-4, "asked")
    assert compared(fit, near, None).agrees
    assert not compared(fit, near, delay(0.0)).agrees
    rejected = replace(delay(0.0), accepted=False)
    assert compared(fit, near, rejected).agrees
