"""Sheets that yield, simulated: the engine's springs, strips that spring back, a run that does."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner

from dualbend.beam.material import find_material
from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.evaluation.permanent_set import hinge_moments, permanent_curvature
from dualbend.evaluation.sheet import sheet_report
from dualbend.scenario.load import load_scenario
from dualbend.scenario.motion import PHASES
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import substance
from dualbend.scene.sheet.strips import (
    StripConfig,
    add_sheet,
    bend_joint,
    hinge_springs,
    hinge_stiffness,
)
from dualbend.validation.cases import material as vm
from support.strip import STRIP6, STRIP8

METAL = vm.yielding_sheet(find_material("5052-H32"))
STRIPS = StripConfig(hinges=4, springs=6)
CLAD = (
    'sheet.layers=[{material="copper-foil", thickness_m=35e-6}, {material="FR-4", '
    'thickness_m=0.4e-3}, {material="copper-foil", thickness_m=35e-6}]'
)


def strip() -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_sheet(spec, METAL, STRIPS, np.zeros(3))
    return spec.compile()


def test_every_configured_spring_arrives_in_the_model() -> None:
    model, springs = strip(), hinge_springs(METAL, STRIPS)
    h = METAL.length_m / STRIPS.hinges
    whole = METAL.bending_stiffness_nm2 / h
    assert model.ntendon == STRIPS.hinges * STRIPS.springs
    np.testing.assert_allclose(
        model.tendon_stiffness.reshape(STRIPS.hinges, -1)[0], springs.share * whole, rtol=1e-12
    )
    np.testing.assert_allclose(
        model.tendon_springyield[: STRIPS.springs], springs.yield_curvature * h, rtol=1e-12
    )
    for hinge in range(STRIPS.hinges):
        # Elastic, they are the hinge of a sheet that does not yield: EI/h.
        assert hinge_stiffness(model, hinge) == pytest.approx(whole, rel=1e-12)


def test_the_engine_follows_the_law_of_parallel_springs() -> None:
    """Statics of prescribed angles: the passive torque at each is the law's moment."""
    model, springs = strip(), hinge_springs(METAL, STRIPS)
    data = mujoco.MjData(model)
    h, first = METAL.length_m / STRIPS.hinges, METAL.plasticity.first_yield(METAL.thickness_m)  # type: ignore[union-attr]
    joint = model.joint(bend_joint(1))
    way = (
        np.concatenate([np.linspace(0, 4, 60), np.linspace(4, -3, 90), np.linspace(-3, 1, 50)])
        * first
    )
    model.opt.timestep = 1e-9  # prescribed angles: nothing has time to move
    torque = []
    for curvature in way:
        for step in (mujoco.mj_step, mujoco.mj_forward):  # a step's end takes the slip over
            data.qpos[:], data.qvel[:] = model.qpos0, 0.0
            data.qpos[joint.qposadr[0]] = curvature * h
            step(model, data)
        torque.append(-data.qfrc_spring[joint.dofadr[0]])
    wanted = springs.follow(way[:, None])[:, 0] * METAL.bending_stiffness_nm2
    np.testing.assert_allclose(torque, wanted, atol=1e-9 * np.abs(wanted).max())  # analytic


@pytest.mark.parametrize("ratio", [0.8, 2.0, 6.0])
def test_a_strip_keeps_what_theory_leaves(ratio: float) -> None:
    found = vm.springback(METAL, ratio)
    if ratio < 1.0:
        assert abs(found.kept) < 1e-6 * found.bent  # elastic: nothing is kept
    else:
        # Acceptance 3 % of the kept curvature; the springs' fit and the turning cost 0.5 %.
        assert found.kept == pytest.approx(found.theory, rel=0.01)


def test_copper_yields_on_a_core_that_does_not() -> None:
    found = vm.springback(vm.clad_sheet()[0], 4.0)
    assert found.kept == pytest.approx(found.theory, rel=0.01)  # as above
    # Statement: the elastic core takes part of the set back; copper alone would keep more.
    foil = vm.yielding_sheet(find_material("copper-foil")).plasticity
    assert foil is not None
    alone = float(foil.residual(np.array([4.0]) * foil.first_yield(1e-3), 1e-3)[0])
    assert found.kept / found.bent < alone / (4.0 * foil.first_yield(1e-3))


def test_more_hinges_keep_the_same() -> None:
    kept = [
        vm.springback(METAL, 3.0, StripConfig(hinges=n, damping_ratio=0.3)).kept for n in (10, 20)
    ]
    assert kept[0] == pytest.approx(kept[1], rel=0.01)  # uniform bending: no order in h


@pytest.mark.slow
def test_the_cell_leaves_a_set_and_says_so() -> None:
    run, result = vm.run_springback()
    assert result.outcome == "completed", result.reason
    assert [PHASES[i] for i in np.unique(result.trace["phase"].astype(int))] == list(PHASES)
    found = result.summary.to_json()
    metrics = {name: metric["value"] for name, metric in found["metrics"].items()}
    assert found["sheet"]["theory"].startswith("does not apply")
    assert metrics["permanent_curvature"] > 1.0  # bent to twice its yield: golden, 4.5
    recorded = permanent_curvature(result)[-1]
    # Statement: forces of the hinges are the engine's own, though only angles are recorded.
    simulation, hinges = run.cell.simulation, result.scenario.sheet.strips.hinges
    model, data = simulation.model, simulation.data
    on_hinges = [model.joint(bend_joint(i)).dofadr[0] for i in range(hinges)]
    last = data.qpos[[model.joint(bend_joint(i)).qposadr[0] for i in range(hinges)]]
    mujoco.mj_forward(model, data)
    moment = -data.qfrc_spring[on_hinges]
    # The last row is a cycle before the end, at rest.
    np.testing.assert_allclose(hinge_moments(result)[-1], moment, atol=1e-3 * np.abs(moment).max())
    assert np.abs(last).max() > 0.0
    free = vm.let_go(run)
    np.testing.assert_allclose(free, recorded, atol=2e-3 * np.abs(recorded).max())
    slope = abs(free.sum()) * 0.4 / hinges / 2.0
    assert metrics["permanent_end_slope"] == pytest.approx(slope, rel=1e-3)


def test_the_elastic_theory_does_not_apply_to_a_sheet_that_would_yield() -> None:
    report = sheet_report(load_scenario("springback", ["sheet.plastic=false"]))
    assert report.exceeds and not report.plastic
    assert report.theory.startswith("does not apply to the real sheet")
    strong = sheet_report(load_scenario(STRIP6, ["sheet.material=2024-T3"]))
    assert not strong.exceeds and strong.theory == "applies"
    assert strong.limit_strain == pytest.approx(345 / 73100)


def test_the_strain_is_that_of_the_nominal_path_in_theory() -> None:
    report = sheet_report(load_scenario("springback"))
    # Analytic on the exact path, up to the sheet's weight: κ t/2 = (4 K/L) sin(α/2) t/2.
    assert report.nominal_strain == pytest.approx(8.0303 * 0.4e-3, rel=0.01)


def test_a_named_material_gives_its_numbers_and_given_ones_win() -> None:
    sheet = load_scenario(STRIP6, ["sheet.material=6061-T6"]).sheet
    assert sheet.sheet().young_pa == 68.9e9
    assert sheet.limit_strain == pytest.approx(276 / 68900)
    # Whichever comes first on the command line.
    for order in ((0, 1), (1, 0)):
        settings = ("sheet.material=6061-T6", "sheet.young_pa=60e9")
        own = load_scenario(STRIP6, [settings[i] for i in order]).sheet.sheet()
        assert (own.young_pa, own.density_kg_per_m3) == (60e9, 2700.0)


def test_a_given_modulus_keeps_the_ratio_of_the_slope_beyond_yield() -> None:
    """Analytic: half of 5052-H32's modulus, half of its 0.29 GPa; a slope that is given wins."""
    half = ["sheet.young_pa=35.15e9"]
    own = substance(load_scenario(STRIP6, half).sheet).layers[0].material
    assert own.tangent_pa == pytest.approx(0.145e9, rel=1e-12)
    given = load_scenario(STRIP6, [*half, "sheet.tangent_pa=1e9"]).sheet
    assert substance(given).layers[0].material.tangent_pa == 1e9
    # The softest sheet that there may be is below that slope itself.
    assert load_scenario(STRIP6, ["sheet.young_pa=1e8"]).sheet.sheet().young_pa == 1e8


def test_the_resolved_file_makes_the_same_sheet_again(tmp_path: Path) -> None:
    for settings in ([CLAD, "sheet.plastic=true"], ["sheet.material=FR-4", "sheet.rigidity=width"]):
        scenario = load_scenario(STRIP8, settings)
        file = tmp_path / "again.toml"
        file.write_text(scenario.to_toml(), encoding="utf-8")
        assert load_scenario(str(file)) == scenario
        assert load_scenario(str(file)).sheet.sheet() == scenario.sheet.sheet()


def test_rigidity_is_a_choice_with_a_consequence() -> None:
    def report(kind: str) -> Scenario:
        return load_scenario(STRIP6, [f"sheet.rigidity={kind}"])

    EI = {kind: report(kind).sheet.sheet().bending_stiffness_nm2 for kind in ("beam", "plate")}
    assert EI["plate"] / EI["beam"] == pytest.approx(1.0 / (1.0 - 0.33**2), rel=1e-12)
    middle = sheet_report(report("width"))
    assert 1.0 < middle.choices["width"].over_beam < middle.choices["plate"].over_beam
    assert middle.choices["width"].end_force_change_percent == pytest.approx(0.0, abs=1e-9)
    back = middle.choices["beam"].end_force_change_percent
    assert back == pytest.approx(100.0 * (1.0 / middle.choices["width"].over_beam - 1.0))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["sheet.material='6061'"], ["material = '6061'", "6061-T6", "spring-steel"]),
        (['sheet.layers=[{material="tin", thickness_m=1e-4}]'], ["layers[0].material", "FR-4"]),
        (
            ['sheet.layers=[{material="copper-foil", thickness_m=35e-6}, '
             '{material="FR-4", thickness_m=0.4e-3}]'],
            ["layers", "not symmetric", "B11", "curl", "mirror"],
        ),
        (['sheet.layers=[{material="FR-4", thick_m=1e-4}]'], ["layers[0].thick_m", "thickness_m"]),
        ([CLAD, "sheet.young_pa=7e10"], ["young_pa", "the layers say it"]),
        ([CLAD, "sheet.thickness_m=0.001"], ["thickness_m", "0.00047"]),
        (["sheet.material=FR-4", "sheet.plastic=true"], ["plastic", "no yield strength"]),
        (["sheet.material=none"], ["young_pa", "missing", "material"]),
        (["sheet.width_m=0.006"], ["thickness_m", "width_m"]),
        (["sheet.rigidity=membrane"], ["rigidity", "'beam', 'plate', 'width'"]),
        (["motion.return_rad=1.5"], ["motion.return_rad", "path.end_rad"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_with_key_reason_and_choices(
    settings: list[str], words: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario(STRIP6, settings)
    assert [word for word in words if word not in str(caught.value)] == []


def test_an_assembly_must_not_yield_and_takes_its_limit_from_the_sheet() -> None:
    with pytest.raises(InputError, match="an assembly ends where the sheet would yield"):
        load_scenario("pwb", ["sheet.material=5052-H32", "sheet.plastic=true"])
    named = load_scenario("pwb", ["sheet.material=6061-T6"])
    assert named.limit_strain == pytest.approx(276 / 68900)
    given = load_scenario("pwb", ["sheet.material=6061-T6", "task.limits.yield_pa=100e6"])
    assert given.limit_strain == pytest.approx(100 / 68900)


def test_the_command_lists_the_library() -> None:
    listed = CliRunner().invoke(main, ["materials"])
    assert listed.exit_code == 0 and "spring-steel" in listed.output
    one = CliRunner().invoke(main, ["materials", "5052-H32", "--json"])
    assert json.loads(one.output)["5052-H32"]["evidence"]["young_pa"]["grade"] == "published"
    wrong = CliRunner().invoke(main, ["materials", "5052"])
    assert wrong.exit_code == 2 and "5052-H32" in wrong.output


def test_the_calculator_knows_materials_and_rigidities() -> None:
    arguments = ["beam", "--length", "0.4", "--width", "0.057", "--thickness", "0.0008"]
    arguments += ["--material", "1100-H14", "--alpha", "1", "--weight", "0", "--json"]
    found = {
        kind: json.loads(CliRunner().invoke(main, [*arguments, "--rigidity", kind]).output)
        for kind in ("beam", "plate")
    }
    assert found["beam"]["beyond_limit"] is True
    change = 100.0 * (found["plate"]["force_n"] / found["beam"]["force_n"] - 1.0)
    assert found["beam"]["force_as_plate_percent"] == pytest.approx(change, rel=1e-9)  # analytic
