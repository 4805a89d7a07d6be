"""Whatever state a board is found in, it is brought to the wish, with few keys."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imu_readings import collect, samples_of
from razor_talk import device

from dialogue import UsageError
from drivers import (
    DeviceFaultError,
    DriverError,
)
from drivers.imu import Motion, Source, at_rest
from drivers.imu.razor import (
    Columns,
    RazorConfig,
    RazorModel,
    setting,
)
from drivers.imu.razor.columns import EVERY, FACTORY, WISHED


def test_a_board_from_the_factory_needs_one_key() -> None:
    model = RazorModel()
    imu, port = device(model)
    imu.connect()
    assert port.written == b"c"
    assert (model.columns, model.flash_writes) == (WISHED, 1)
    identity = imu.identify()
    assert identity["keys_pressed"] == "c"
    assert identity["accel_range"] == "2 g"
    assert identity["gyro_range"] == "2000 deg/s (the factory's: not to be seen)"
    assert port.now_ns() < 5e8


def test_a_board_that_is_as_wished_is_not_touched() -> None:
    model = RazorModel(columns=WISHED)
    imu, port = device(model)
    imu.connect()
    assert not port.written
    assert model.flash_writes == 0
    assert imu.identify()["flash"] == "unchanged"


def keys_needed(columns: Columns) -> int:
    return sum(a != b for a, b in zip(vars(columns).values(), vars(WISHED).values(), strict=True))


def as_recorded(t_ns: int) -> Motion:
    """A real chip at rest: bias and size of 1 g of the recording in data/imu, tilted a little."""
    tremble = 2e-3 * math.sin(1e-7 * t_ns)
    return Motion(
        (0.0093 + tremble, -0.001, -0.0353),
        (0.65, 4.02, 9.45 + 10.0 * tremble),
        (-20e-6, 8e-6, 38e-6),
        yaw_pitch_roll_rad=(2.0, 0.4, -0.07),
    )


@pytest.mark.parametrize("source", [at_rest, as_recorded])
def test_every_state_is_brought_to_the_wish_with_the_fewest_keys(source: Source) -> None:
    for columns in EVERY:
        model = RazorModel(source, columns=columns)
        imu, port = device(model)
        imu.connect()
        assert model.columns == WISHED, columns
        assert len(port.written) == keys_needed(columns), columns
        assert port.now_ns() < 5e9
        assert samples_of(collect(imu, port, 0.05))


def test_a_car_that_moves_at_start_is_brought_to_the_wish_all_the_same() -> None:
    """Sizes mislead then; keys may be wasted, but what comes out is right."""

    def driving(_: int) -> Motion:
        return Motion((0.1, -0.4, 4.0), (6.0, 9.0, 12.0))

    for columns in EVERY:
        model = RazorModel(driving, columns=columns)
        imu, port = device(model)
        imu.connect()
        assert model.columns == WISHED
        assert len(port.written) <= keys_needed(columns) + 8


def test_a_wrong_first_guess_is_found_out_by_the_next_key() -> None:
    """One degree of yaw alone looks like 1 g; the key c shows that it is none."""
    columns = Columns(True, False, False, False, False, True, False, raw=False)
    imu, port = device(
        RazorModel(lambda _: Motion(yaw_pitch_roll_rad=(math.radians(1), 0, 0)), columns=columns)
    )
    imu.connect()
    assert isinstance(port.model, RazorModel)
    assert port.model.columns == WISHED
    assert port.written == b"cagme"


def test_a_board_whose_keys_do_something_else_is_given_up_at_the_first() -> None:
    class Odd(RazorModel):
        def _press(self, key: str, now_ns: int) -> None:  # noqa: ARG002  its signature
            super()._press("e", now_ns)

    model = Odd()
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match="does not do as the key 'c' says"):
        imu.connect()
    assert model.flash_writes == 1


def test_the_flash_is_not_worn_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setting, "MOST_KEYS", 7)
    model = RazorModel()
    model.rate_hz = 1
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match=r"100 Hz with 7 keys \(rrrrrrr\)"):
        imu.connect()
    assert model.flash_writes == 7


def test_a_rate_that_cannot_be_had() -> None:
    class Slow(RazorModel):
        def _press(self, key: str, now_ns: int) -> None:
            super()._press(key, now_ns)
            self.rate_hz = min(self.rate_hz, 50)

    model = Slow(columns=WISHED)
    model.rate_hz = 50
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match=r"does not answer the key 'r' with 100 \(it said"):
        imu.connect()


@pytest.mark.parametrize("rate_hz", [1, 10, 50, 60])
def test_the_rate_is_stepped_up_until_the_board_says_100(rate_hz: int) -> None:
    model = RazorModel()
    model.rate_hz = rate_hz
    imu, port = device(model)
    imu.connect()
    assert model.rate_hz == 100
    assert port.written.count(b"r") == (100 - rate_hz + 9) // 10
    assert port.now_ns() < 5e9


@pytest.mark.parametrize("rate_hz", [70, 80, 90])
def test_what_the_dmp_rounds_to_100_hz_needs_no_key(rate_hz: int) -> None:
    model = RazorModel(columns=WISHED)
    model.rate_hz = rate_hz
    imu, port = device(model)
    imu.connect()
    assert not port.written


@pytest.mark.parametrize("columns", [FACTORY, replace(FACTORY, time=False, heading=True)])
def test_one_line_a_second_is_sped_up_before_anything_else(columns: Columns) -> None:
    model = RazorModel(columns=columns)
    model.rate_hz = 1
    imu, port = device(model)
    imu.connect()
    assert (model.columns, model.rate_hz) == (WISHED, 100)
    assert port.written.startswith(b"r" * 10)
    assert port.now_ns() < 5e9


@pytest.mark.parametrize("range_g", [2, 4, 8, 16])
def test_the_accelerometers_full_scale_is_seen_at_rest(range_g: int) -> None:
    model = RazorModel(columns=WISHED)
    model.accel_range_g = range_g
    imu, port = device(model)
    imu.connect()
    assert imu.identify()["accel_range_g"] == range_g
    z = samples_of(collect(imu, port, 0.1))[-1].linear_acceleration_m_s2[2]
    assert z == pytest.approx(9.80665, abs=0.01)
    assert port.written == b""


def test_full_scales_that_are_wished_are_set_once() -> None:
    model = RazorModel()
    imu, port = device(model, RazorConfig(accel_range_g=8, gyro_range_deg_s=1000))
    imu.connect()
    assert (model.accel_range_g, model.gyro_range_deg_s) == (8, 1000)
    assert port.written == b"cAAGGG"
    assert imu.identify()["gyro_range"] == "1000 deg/s"
    imu.close()
    imu.connect()
    assert port.written == b"cAAGGG"  # it is in flash: not again
    sample = samples_of(collect(imu, port, 0.1))[-1]
    assert sample.linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)


def test_a_moving_car_does_not_unlearn_its_full_scale() -> None:
    hard = False

    def source(t_ns: int) -> Motion:
        motion = at_rest(t_ns)
        return replace(motion, linear_acceleration_m_s2=(7.0, 7.0, 9.8)) if hard else motion

    model = RazorModel(source)
    imu, port = device(model)
    imu.connect()
    imu.close()
    hard = True
    imu.connect()
    assert imu.identify()["accel_range_g"] == 2
    fresh, _ = device(model)
    fresh.connect()
    assert fresh.identify()["accel_range"] == "2 g (likely: it moved at start)"
    assert port.written == b"c"


@settings(max_examples=25)
@given(st.sampled_from(EVERY), st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_whatever_the_board_does_connect_ends_in_time(
    columns: Columns, boot_ms: int, skip_every: int
) -> None:
    model = RazorModel(columns=columns, boot_ms=boot_ms)
    model.skip_every = skip_every
    imu, port = device(model)
    try:
        imu.connect()
    except DriverError:
        assert port.closed
        assert skip_every == 1
    else:
        assert model.columns == WISHED
    assert port.now_ns() < 5e9


@pytest.mark.parametrize(("g", "deg_s"), [(3, None), (None, 300)])
def test_a_full_scale_that_there_is_not(g: int | None, deg_s: int | None) -> None:
    with pytest.raises(UsageError, match="the board knows"):
        RazorConfig(accel_range_g=g, gyro_range_deg_s=deg_s)
