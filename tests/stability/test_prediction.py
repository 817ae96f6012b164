"""The prediction for a scenario: verdict, ranges, map, and the command that prints them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.stability.map import stability_map
from dualbend.stability.plant.environment import environments
from dualbend.stability.prediction import predict, unstable_ranges
from dualbend.stability.sampled import LoopElements, SampledLoop
from support.strip import STRIP6, STRIP8, STRIP9


def call(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["stability", *arguments])
    return result.exit_code, result.output


def test_fig8_is_predicted_stable_everywhere() -> None:
    found = predict(load_scenario(STRIP8))
    assert found.verdict == "stable"
    assert found.unstable_rad == ()
    assert [round(row.alpha_rad, 3) for row in found.rows] == [
        round(0.2 + 0.05 * i, 3) for i in range(17)
    ]
    assert all(
        row.stable and row.delayed_stable and row.gain_margin_db > 15.0 for row in found.rows
    )


def test_fig9_is_predicted_unstable_at_first_as_the_simulation_is() -> None:
    found = predict(load_scenario(STRIP9))
    assert found.verdict == "unstable"
    ((low, high),) = found.unstable_rad
    # Golden: the simulated oscillation stops growing at 0.3-0.4 rad.
    assert low == pytest.approx(0.2)
    assert high == pytest.approx(0.34, abs=0.02)
    first = found.rows[0]
    # Golden against the simulation: 5.9 /s; 2.2 Hz over its whole range, 2.6 Hz in the first
    # period, during which the angle goes on.
    assert first.growth_per_s == pytest.approx(5.9, rel=0.1)
    assert 2.2 < first.frequency_hz < 2.8
    assert first.phase_margin_deg < 0.0
    assert first.delay_margin_s < 0.0
    # The paper's condition without delay sees nothing of it.
    assert all(row.paper_stable for row in found.rows)
    assert not first.delayed_stable


def test_a_looser_loop_is_more_stable_and_more_delay_less() -> None:
    radius = {
        delay: predict(load_scenario(STRIP8, [f"robot.alter.delay_cycles={delay}"]))
        .rows[0]
        .gain_margin_db
        for delay in (0, 2, 4)
    }
    assert radius[0] > radius[2] > radius[4]


def test_axis_selects_what_takes_part() -> None:
    rows = {axis: predict(load_scenario(STRIP9), axis).rows for axis in ("x", "rotation")}  # type: ignore[arg-type]
    assert {row.axes for row in rows["x"]} == {("x",)}
    assert {row.axes for row in rows["rotation"]} == {("rotation",)}
    assert not rows["x"][0].stable
    assert rows["rotation"][0].stable


def test_axes_come_in_at_their_own_angles() -> None:
    scenario = load_scenario(STRIP8, ["compliance.x.from_alpha_rad=0.43"])
    found = predict(scenario)
    axes = {round(row.alpha_rad, 3): row.axes for row in found.rows}
    assert axes[0.4] == ("rotation",)
    assert axes[0.43] == ("x", "rotation")


@pytest.mark.parametrize(
    ("settings", "axis", "reason"),
    [
        (["compliance.complying=[]"], "coupled", "no compliance: nothing to be unstable"),
        (["path.end_rad=0.1"], "x", "acts from 0.2 rad on and the path ends at 0.1"),
    ],
)
def test_without_compliance_nothing_is_unstable(
    settings: list[str], axis: str, reason: str
) -> None:
    found = predict(load_scenario(STRIP8, settings), axis)  # type: ignore[arg-type]
    assert found.verdict == "no compliance"
    assert reason in found.reason
    with pytest.raises(InputError, match="--map"):
        stability_map(load_scenario(STRIP8, settings), found)


def test_ranges_are_interpolated() -> None:
    # Analytic.
    assert unstable_ranges([0.0, 1.0, 2.0], [-1.0, 1.0, -3.0]) == ((0.5, 1.25),)
    assert unstable_ranges([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]) == ((0.0, 2.0),)
    assert unstable_ranges([0.0, 1.0], [-1.0, -1.0]) == ()
    assert unstable_ranges([0.0, 1.0, 2.0], [1.0, -1.0, 1.0]) == ((0.0, 0.5), (1.5, 2.0))


def test_the_maps_boundary_is_the_loops() -> None:
    scenario = load_scenario(STRIP9)
    predicted = predict(scenario)
    panels = stability_map(scenario, predicted)
    assert [panel.axis for panel in panels] == ["x", "rotation"]
    for panel, acting in zip(panels, ((True, False), (False, True)), strict=True):
        alpha = next(iter(panel.stiffness))
        (at,) = environments(scenario, [alpha])
        arm = at.arms["single"]
        for i, j in ((5, 70), (40, 80), (60, 20)):
            margin = float(panel.sampled[alpha][i, j])
            settings = [
                f"compliance.{panel.axis}.b={panel.b[i]!r}",
                f"compliance.{panel.axis}.k={panel.k[j]!r}",
            ]
            parts = LoopElements.from_scenario(
                load_scenario(STRIP9, [s.replace("np.float64(", "").rstrip(")") for s in settings])
            )
            # A larger gain of the filter is the same as a larger reading.
            louder = replace(
                arm,
                stiffness_read=margin * arm.stiffness_read,
                mass_read=margin * arm.mass_read,
            )
            mode = SampledLoop(parts, at.loops["single"], acting, arm=louder).mode()
            # Discretisation-limited: the sweep's steps, second order.
            assert mode.spectral_radius == pytest.approx(1.0, abs=3e-5)
        assert panel.b[40] == pytest.approx(panel.gains[0])
        assert panel.k[80] == pytest.approx(panel.gains[1])


def test_the_command_prints_verdict_and_range() -> None:
    code, output = call(STRIP9)
    assert code == 0
    assert "predicted unstable from 0.20 to 0.3" in output
    assert "strip-fig9: unstable (worst at 0.20 rad" in output
    code, output = call(STRIP6)
    assert (code, output) == (0, "strip-fig6: no compliance: nothing to be unstable\n")


def test_json_is_strict_and_complete() -> None:
    code, output = call(STRIP8, "--json")
    assert code == 0

    def refuse(token: str) -> float:
        raise AssertionError(token)

    found = json.loads(output, parse_constant=refuse)
    assert found["verdict"] == "stable"
    # An infinite margin is null.
    assert found["rows"][0]["delay_margin_s"] is None
    assert math.isfinite(found["rows"][0]["gain_margin_db"])


def test_the_map_is_written_or_refused(tmp_path: Path) -> None:
    code, _ = call(STRIP9, "--map", str(tmp_path / "map.png"))
    assert code == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    code, _ = call(STRIP9, "--map", str(tmp_path / "nowhere" / "map.png"))
    assert code == 2


@pytest.mark.parametrize(
    "setting", ["compliance.x.k=-1.0", "robot.alter.delay_cycles=1.5", "compliance.x.b=0"]
)
def test_bad_input_is_refused(setting: str) -> None:
    code, _ = call(STRIP9, "--set", setting)
    assert code == 2
