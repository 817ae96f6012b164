"""Time laws: ends, speed and acceleration as stated, folding and unfolding."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.beam.time_law import ConstantSpeed, TimeLaw, TrapezoidalSpeed
from dualbend.errors import InputError

angle = st.floats(0.0, 2.2)
seeded = settings(max_examples=60, derandomize=True)


def laws(start: float, end: float, speed: float, acceleration: float) -> list[TimeLaw]:
    """Both laws for the same motion."""
    return [ConstantSpeed(start, end, speed), TrapezoidalSpeed(start, end, speed, acceleration)]


@given(start=angle, end=angle, speed=st.floats(0.01, 2.0), acceleration=st.floats(0.01, 5.0))
@seeded
def test_starts_and_stops_exactly_and_never_turns_back(
    start: float, end: float, speed: float, acceleration: float
) -> None:
    for law in laws(start, end, speed, acceleration):
        t = np.linspace(0.0, law.duration_s, 301)
        alpha = law.at(t)
        # Analytic: the ends to the bit, also outside the motion.
        assert (law.at(-1.0), law.at(0.0)) == (start, start)
        assert (law.at(law.duration_s), law.at(law.duration_s + 1.0)) == (end, end)
        # Monotone to rounding.
        assert np.all(np.diff(alpha) * np.sign(end - start) >= -1e-12)
        # The speed itself, to the rounding of α over a step.
        assert np.all(np.abs(np.diff(alpha)) <= speed * np.diff(t) * (1 + 1e-9) + 1e-15)


@given(start=angle, end=angle, speed=st.floats(0.01, 2.0), acceleration=st.floats(0.05, 5.0))
@seeded
def test_acceleration_stays_finite(
    start: float, end: float, speed: float, acceleration: float
) -> None:
    law = TrapezoidalSpeed(start, end, speed, acceleration)
    cell = law.duration_s / 400
    alpha = law.at(np.linspace(-2 * cell, law.duration_s + 2 * cell, 405))
    # Analytic bound on the second difference; α is rounded to 4e-16.
    assert np.abs(np.diff(alpha, 2)).max() <= acceleration * cell**2 * (1 + 1e-6) + 2e-15


def test_trapezoid_has_the_textbook_duration_and_half_way() -> None:
    law = TrapezoidalSpeed(0.0, 1.0, 0.1, 0.2)
    # Analytic: way/speed + speed/acceleration, and half the way at half the time.
    assert law.duration_s == pytest.approx(10.5, rel=1e-15)
    assert law.at(law.duration_s / 2) == pytest.approx(0.5, rel=1e-14)
    assert law.at(0.25) == pytest.approx(0.1 * 0.2 * 0.25**2 / 0.2, rel=1e-14)


def test_short_way_is_a_triangle() -> None:
    law = TrapezoidalSpeed(0.5, 0.4, 1.0, 0.1)
    # Analytic: top speed √(a way), duration 2 √(way/a).
    assert law.top_speed_rad_per_s == pytest.approx(0.1, rel=1e-12)
    assert law.duration_s == pytest.approx(2.0, rel=1e-12)
    # Half the way, at the top speed.
    assert law.at(1.0) == pytest.approx(0.45, rel=1e-12)
    assert law.at(1.001) - law.at(0.999) == pytest.approx(-0.2e-3, rel=1e-3)


def test_no_way_takes_no_time() -> None:
    for law in laws(0.3, 0.3, 0.1, 0.2):
        # Analytic.
        assert law.duration_s == 0.0
        assert law.at(np.array([-1.0, 0.0, 1.0])) == pytest.approx(0.3, abs=0)


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf])
def test_refuses_speeds_that_do_not_move(bad: float) -> None:
    with pytest.raises(InputError, match="speed_rad_per_s"):
        ConstantSpeed(0.0, 1.0, bad)
    with pytest.raises(InputError, match="acceleration_rad_per_s2"):
        TrapezoidalSpeed(0.0, 1.0, 0.1, bad)
    with pytest.raises(InputError, match="end_rad"):
        ConstantSpeed(0.0, math.nan, 0.1)
