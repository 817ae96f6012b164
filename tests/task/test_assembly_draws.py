"""Drawn assemblies: what differs, by how much, and what the robots go on believing."""

import math

import msgspec
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.task.assembly.config import ErrorsConfig, SpreadConfig
from dualbend.task.assembly.draws import assembly_of, draw, misalignment

PWB = load_scenario("pwb")


def with_errors(**errors: float) -> Scenario:
    changed = msgspec.structs.replace(assembly_of(PWB), errors=ErrorsConfig(**errors))
    return msgspec.structs.replace(PWB, task=changed)


def test_draws_have_the_spread_that_the_scenario_gives() -> None:
    """Statistical, n = 2000: a mean is within 4 σ/√n, a standard deviation within 4/√(2n) = 6 %."""
    n, spread = 2000, SpreadConfig()
    drawn = [assembly_of(draw(PWB, 3, i)) for i in range(n)]
    errors = {
        name: np.array([getattr(d.errors, name) for d in drawn])
        for name in ErrorsConfig.__struct_fields__
        if not name.startswith("scatter")
    }
    for name in ("pickup_x_m", "pickup_y_m", "pickup_yaw_rad"):
        sigma = getattr(spread, name)
        assert abs(errors[name].mean()) < 4.0 * sigma / math.sqrt(n)
        assert errors[name].std() == pytest.approx(sigma, rel=4.0 / math.sqrt(2 * n))
    for name in ("thickness", "modulus", "friction"):
        sigma, factor = getattr(spread, name), errors[f"{name}_factor"]
        assert abs(factor.mean() - 1.0) < 4.0 * sigma / math.sqrt(n)
        # A log-normal's tail is heavier: 20 % makes the deviation's own error 1.2 times larger.
        assert factor.std() == pytest.approx(sigma, rel=1.2 * 4.0 / math.sqrt(2 * n))
        assert factor.min() > 0.0
    holes = np.array([d.layout.holes.errors_m for d in drawn])
    assert holes.std() == pytest.approx(spread.hole_m, rel=4.0 / math.sqrt(16 * n))
    # What is drawn apart is independent: a correlation is within 4/√n.
    columns = np.column_stack((*errors.values(), holes.reshape(n, -1)))
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert np.abs(correlation).max() < 4.0 / math.sqrt(n)


def test_what_is_fed_forward_of_the_friction_is_uniform() -> None:
    n, (low, high) = 500, SpreadConfig().fed_forward
    share = np.array([1.0 / draw(PWB, 3, i).imperfections.robot.coulomb_ratio for i in range(n)])
    # Statistical: Kolmogorov's distance to the uniform law, at the level of 1e-3.
    found = np.sort((share - low) / (high - low))
    assert np.abs(found - (np.arange(n) + 0.5) / n).max() < 1.95 / math.sqrt(n)


def test_a_range_the_other_way_round_is_refused() -> None:
    with pytest.raises(InputError, match=r"fed_forward = \[1.4, 0.6\]: the lower one comes first"):
        load_scenario("pwb", ["task.spread.fed_forward=[1.4, 0.6]"])


def test_the_robots_believe_what_they_believed() -> None:
    """Analytic: only the truth, and the noise's seed, differ from the scenario."""
    drawn = draw(PWB, 1, 5)
    config, nominal = assembly_of(drawn), assembly_of(PWB)
    replace = msgspec.structs.replace
    holes = replace(config.layout.holes, errors_m=nominal.layout.holes.errors_m)
    believed = replace(config, errors=nominal.errors, layout=replace(config.layout, holes=holes))
    robot = replace(drawn.imperfections.robot, coulomb_ratio=1.0)
    imperfections = replace(drawn.imperfections, robot=robot)
    assert replace(drawn, task=believed, imperfections=imperfections, seed=PWB.seed) == PWB
    true, sheet = config.true_sheet(PWB.sheet.sheet()), PWB.sheet.sheet()
    factor = config.errors.thickness_factor
    assert true.mass_kg / sheet.mass_kg == pytest.approx(factor, rel=1e-12)
    assert true.bending_stiffness_nm2 / sheet.bending_stiffness_nm2 == pytest.approx(
        config.errors.modulus_factor * factor**3, rel=1e-12
    )


def test_a_draw_depends_on_its_own_number_and_on_no_other_width() -> None:
    """Analytic: the same draw, alone or among many; draws of other numbers and seeds differ."""
    assert draw(PWB, 1, 5) == draw(PWB, 1, 5)
    seen = {msgspec.json.encode(draw(PWB, seed, i)) for seed in (1, 2) for i in range(20)}
    assert len(seen) == 40
    spread = msgspec.structs.replace(assembly_of(PWB).spread, pickup_x_m=0.0, friction=0.0)
    narrow = msgspec.structs.replace(assembly_of(PWB), spread=spread)
    errors = assembly_of(draw(msgspec.structs.replace(PWB, task=narrow), 1, 5)).errors
    wide = assembly_of(draw(PWB, 1, 5)).errors
    assert errors == msgspec.structs.replace(wide, pickup_x_m=0.0, friction_factor=1.0)


def test_errors_that_the_scenario_has_stay_the_mean() -> None:
    """Analytic: an offset is added, a factor multiplied."""
    base, moved = PWB, with_errors(pickup_y_m=1e-3, modulus_factor=1.5)
    plain, errors = (assembly_of(draw(s, 1, 2)).errors for s in (base, moved))
    assert errors.pickup_y_m - plain.pickup_y_m == pytest.approx(1e-3, rel=1e-12)
    assert errors.modulus_factor / plain.modulus_factor == pytest.approx(1.5, rel=1e-12)
    assert errors.pickup_x_m == plain.pickup_x_m


def test_misalignment_is_the_distance_of_the_worst_hole() -> None:
    """Analytic: a shift moves all holes alike, a turn the outer ones by 2 s₁ sin(ψ/2)."""
    assert misalignment(with_errors(pickup_x_m=3e-4, pickup_y_m=-4e-4)) == pytest.approx(5e-4)
    turned = with_errors(pickup_yaw_rad=0.01)
    assert misalignment(turned) == pytest.approx(2.0 * 0.14 * math.sin(0.005), rel=1e-9)
    both = with_errors(pickup_yaw_rad=0.01, pickup_y_m=1e-3)
    assert misalignment(both) == pytest.approx(1e-3 + 0.14 * math.sin(0.01), rel=1e-3)


@pytest.mark.parametrize("name", SpreadConfig.__struct_fields__)
def test_a_negative_width_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=rf"task\.spread\.{name} = -0\.1"):
        load_scenario("pwb", [f"task.spread.{name}=-0.1"])
