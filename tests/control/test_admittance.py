"""The admittance filters: their published numbers, laws and the loop they close."""

import math
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import (
    DEG_PER_RAD,
    Admittance,
    AdmittanceConfig,
)
from dualbend.control.compliance.base import AdmittanceForm, AxisConfig
from dualbend.control.delay import TransportDelay
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.types import Vector

T = COMMAND_PERIOD_S
FORMS: list[AdmittanceForm] = ["printed", "impulse-invariant", "static"]
LOADS = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30)


def make(form: AdmittanceForm = "printed", **settings: float) -> Admittance:
    """Return the published admittance: (7, 575) along x and (0.5, 10000) about y."""
    return Admittance(
        AdmittanceConfig(
            x=AxisConfig(b=7.0, k=575.0, form=form),
            rotation=AxisConfig(b=0.5, k=1e4, form=form),
            **settings,
        ),
        period_s=T,
    )


def update(admittance: Admittance, force: float, moment: float, alpha: float) -> list[float]:
    """Run one cycle; return δx, δα."""
    return admittance.update(np.array([force, moment]), alpha).tolist()


def stream(admittance: Admittance, which: str, loads: Iterable[float]) -> list[float]:
    """Return the deviations of one axis."""
    column = ("x", "rotation").index(which)
    return [update(admittance, load, load, math.inf)[column] for load in loads]


@pytest.mark.parametrize(
    ("form", "times_k"),
    [("printed", 91.30), ("impulse-invariant", 2.556), ("static", 1.0)],
)
def test_static_compliance_of_the_published_x_axis(form: AdmittanceForm, times_k: float) -> None:
    axis = make(form).x
    a = math.exp(-2.3)
    gain = {"printed": 1 / 7, "impulse-invariant": T / 7, "static": (1 - a) / 575}[form]
    # Analytic: 1 mm/N is 1e-3 m/N.
    assert math.isclose(axis.static_compliance, 1e-3 * gain / (1 - a), rel_tol=1e-13)
    # Golden: the quoted multiple of 1/k.
    assert axis.static_compliance * 575e3 == pytest.approx(times_k, rel=1e-3)


def test_printed_static_compliance_is_0_1588_mm_per_n() -> None:
    # Golden: four digits.
    assert make().x.static_compliance == pytest.approx(0.1588e-3, abs=5e-8)


def test_stiffness_of_the_published_rotation_has_no_effect() -> None:
    axis = make().rotation
    other = Admittance(AdmittanceConfig(rotation=AxisConfig(b=0.5, k=5e3)), period_s=T).rotation
    # Analytic: a = e^−560 is 0 beside 1, so the filter is the gain 1/b = 2 deg/(N m).
    assert axis.pole < 1e-243
    assert axis.static_compliance == pytest.approx(2.0 * math.pi / 180, rel=1e-14)
    assert other.static_compliance == axis.static_compliance


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("which", ["x", "rotation"])
def test_impulse_response_is_the_transfer_functions(form: AdmittanceForm, which: str) -> None:
    admittance = make(form, limit_rotation_rad=100.0)
    impulse = np.zeros(40)
    impulse[0] = 0.5
    response = stream(admittance, which, impulse)
    # Analytic: the same recursion.
    expected = signal.lfilter(*getattr(admittance, which).transfer_function(), impulse)
    assert np.allclose(response, expected, rtol=1e-12, atol=0)


def test_impulse_invariant_form_samples_the_continuous_impulse_response() -> None:
    response = stream(make("impulse-invariant"), "x", [1.0] + [0.0] * 9)
    time = T * np.arange(10)
    # Analytic: T h(t) = (T/b) e^(−kt/b), with b = 7000 N s/m.
    assert np.allclose(response, T / 7000 * np.exp(-575 / 7 * time), rtol=1e-12, atol=0)


def test_static_form_is_the_exact_response_to_a_held_force() -> None:
    response = stream(make("static"), "x", [10.0] * 10)
    time = T * np.arange(1, 11)
    # Analytic: solution of b δ' + k δ = F for constant F, with k = 575 000 N/m.
    assert np.allclose(response, 10 / 575e3 * -np.expm1(-575 / 7 * time), rtol=1e-12, atol=0)


@given(LOADS, st.sampled_from(FORMS), st.floats(0.01, 100), st.floats(0.01, 1e4))
def test_units_are_only_a_name_for_the_same_filter(
    loads: list[float], form: AdmittanceForm, b: float, k: float
) -> None:
    paper = Admittance(
        AdmittanceConfig(
            x=AxisConfig(b=b, k=k, form=form), rotation=AxisConfig(b=b, k=k, form=form)
        ),
        period_s=T,
    )
    si = Admittance(
        AdmittanceConfig(
            units="si",
            x=AxisConfig(b=b * 1e3, k=k * 1e3, form=form),
            rotation=AxisConfig(b=b * DEG_PER_RAD, k=k * DEG_PER_RAD, form=form),
        ),
        period_s=T,
    )
    for load in loads:
        # Exact: the conversion happens once, at construction.
        assert update(paper, load, load, 0.1) == update(si, load, load, 0.1)


@given(LOADS, st.sampled_from(FORMS))
def test_deviation_is_bounded_and_flagged_for_all_loads(
    loads: list[float], form: AdmittanceForm
) -> None:
    admittance = make(form, limit_x_m=0.002, limit_rotation_rad=0.01)
    for load in loads:
        for size, limit, saturated in zip(
            np.abs(update(admittance, load, load, 0.0)),
            (0.002, 0.01),
            admittance.saturated,
            strict=True,
        ):
            # Exact: a clamp.
            assert size <= limit
            assert not saturated or size == limit


def test_clamped_state_does_not_wind_up() -> None:
    config = AdmittanceConfig(x=AxisConfig(b=7, k=5), limit_x_m=0.002)
    admittance = Admittance(config, period_s=T)
    for _ in range(1000):
        update(admittance, 1e3, 0.0, 0.0)
    assert admittance.saturated.tolist() == [True, False]
    after, _ = update(admittance, 0.0, 0.0, 0.0)
    # Analytic: it leaves the limit at once, by the pole e^(−kT/b) = e^−0.02.
    assert math.isclose(after, 0.002 * math.exp(-0.02), rel_tol=1e-12)
    assert not admittance.saturated.any()


@given(st.floats(0, 1e4), st.sampled_from(FORMS))
def test_it_yields_in_the_direction_of_the_load(load: float, form: AdmittanceForm) -> None:
    admittance = make(form)
    pushed, turned = update(admittance, -load, load, 0.5)
    # Exact signs: a compressive end force pushes the grip outward, a moment adds to the bending.
    assert pushed <= 0.0 <= turned


def test_an_axis_that_is_off_does_nothing() -> None:
    admittance = Admittance(AdmittanceConfig(), period_s=T)
    # Exact.
    assert update(admittance, 50.0, 3.0, 1.0) == [0.0, 0.0]
    assert not admittance.saturated.any()


def test_each_axis_sees_only_its_own_load() -> None:
    # Exact.
    assert update(make(), 0.0, 1.0, 0.3)[0] == 0.0
    assert update(make(), 1.0, 0.0, 0.3)[1] == 0.0


def scheduled(*, tare: bool = False) -> Admittance:
    return Admittance(
        AdmittanceConfig(
            x=AxisConfig(b=7.0, k=575.0, from_alpha_rad=0.2),
            rotation=AxisConfig(b=0.5, k=1e4),
            tare=tare,
        ),
        period_s=T,
    )


def test_an_axis_acts_from_its_bending_angle_on() -> None:
    admittance = scheduled()
    for alpha in (0.0, 0.1, 0.1999):
        dx, dalpha = update(admittance, -30.0, 0.1, alpha)
        # Exact, and the other axis acts from the start.
        assert dx == 0.0
        assert dalpha > 0.0
    # Analytic: the first output after switching on is F/b.
    assert update(admittance, -30.0, 0.1, 0.2)[0] == pytest.approx(-30e-3 / 7, rel=1e-14)


def test_an_axis_switched_off_by_unfolding_dies_out_with_its_pole() -> None:
    admittance = scheduled()
    for _ in range(20):
        last = update(admittance, -30.0, 0.1, 0.5)[0]
    for _ in range(5):
        now = update(admittance, -30.0, 0.1, 0.1)[0]
        # Analytic: δ[n] = a δ[n−1], whatever the force.
        assert math.isclose(now, math.exp(-2.3) * last, rel_tol=1e-12)
        last = now


def test_tare_takes_the_reading_at_which_the_axis_is_switched_on() -> None:
    admittance = scheduled(tare=True)
    update(admittance, -10.0, 0.3, 0.1)
    # Exact: no load relative to the reference, on either axis.
    assert update(admittance, -20.0, 0.3, 0.3) == [0.0, 0.0]
    # Analytic: F = 7 N and M = 0.1 N m above the two references.
    second = update(admittance, -13.0, 0.4, 0.3)
    assert second == pytest.approx([1e-3, math.radians(0.2)], rel=1e-12)
    update(admittance, -13.0, 0.4, 0.1)
    # Analytic: a new reference at the new switch-on; what remains is the old state, aged twice.
    assert update(admittance, -40.0, 0.4, 0.3)[0] == pytest.approx(1e-3 * math.exp(-4.6), rel=1e-9)


@pytest.mark.parametrize(
    ("form", "limits"),
    [
        ("printed", (39.9, 22.2, 16.4, 13.5)),
        ("impulse-invariant", (1425.0, 793.0, 584.0, 481.0)),
    ],
)
def test_largest_stable_environment_of_the_sampled_loop(
    form: AdmittanceForm, limits: tuple[float, ...]
) -> None:
    """δ = H F closes over the robot (2 Hz, 2ξω_n = 25 rad/s), a delay and a stiffness k_e."""
    robot = CommandResponse(
        CommandResponseConfig(damping_ratio=25 / (8 * math.pi)), 1, 1, period_s=T
    )
    for cycles, limit in enumerate(limits):
        numerator, denominator = np.ones(1), np.ones(1)
        for element in (robot, make(form).x, TransportDelay(cycles, 1)):
            n, d = element.transfer_function()
            numerator, denominator = np.convolve(numerator, n), np.convolve(denominator, d)
        length = max(numerator.size, denominator.size)
        numerator, denominator = (np.pad(p, (0, length - p.size)) for p in (numerator, denominator))

        def radius(k_e_n_per_mm: float, n: Vector = numerator, d: Vector = denominator) -> float:
            return float(np.abs(np.roots(d + 1e3 * k_e_n_per_mm * n)).max())

        # Golden: limits known to three digits, from an independent computation [N/mm].
        assert radius(0.99 * limit) < 1.0 < radius(1.01 * limit)


@pytest.mark.parametrize(
    ("wrong", "path"),
    [
        ({"x": {"b": -7.0, "k": 575.0}}, r"\$\.x\.b"),
        ({"x": {"b": 7.0, "k": 0.0}}, r"\$\.x\.k"),
        ({"rotation": {"b": 7.0}}, r"missing required field `k`.*\$\.rotation"),
        ({"x": {"b": 7.0, "k": 1.0, "form": "tustin"}}, r"\$\.x\.form"),
        ({"rotation": {"b": 7.0, "k": 1.0, "from_alpha_rad": -0.1}}, "from_alpha_rad"),
        ({"units": "imperial"}, r"\$\.units"),
        ({"limit_x_m": 0.0}, r"\$\.limit_x_m"),
        ({"y": {"b": 7.0, "k": 1.0}}, "unknown field `y`"),
    ],
)
def test_wrong_settings_are_refused_by_name(wrong: dict[str, Any], path: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=path):
        msgspec.convert(wrong, AdmittanceConfig)
