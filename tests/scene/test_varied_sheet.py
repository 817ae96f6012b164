"""A sheet whose thickness varies, or that is curved at rest, as strips and in a run."""

import mujoco
import numpy as np
import pytest

from dualbend.beam.path import ExactPath
from dualbend.beam.sheet import Sheet, mean_thickness
from dualbend.errors import InputError
from dualbend.evaluation.metrics import surface_strain
from dualbend.evaluation.permanent_set import hinge_moments
from dualbend.evaluation.recorded_rod import recorded_rods, reference_moments
from dualbend.evaluation.sheet import nominal_strain
from dualbend.report.moment import reference_on_path
from dualbend.run.arm_load import sheet_load
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario, parse_scenario
from dualbend.scenario.sheet import with_true_numbers
from dualbend.scene.sheet.strips import StripConfig, add_sheet, bend_joint, strip_body, twist_joint
from dualbend.stability.prediction import predict
from dualbend.validation.cases.sheet import reference_loads, settled_loads
from support.sheets import STRIP

L, T = STRIP.length_m, STRIP.thickness_m
STEPPED = ((0.0, 0.8 * T), (0.13, 0.8 * T), (0.13, 1.2 * T), (0.31, T), (L, T))
TAPERED = ((0.0, 0.8 * T), (L, 1.2 * T))
ALIGNED = ((0.0, 0.8 * T), (0.12, 0.8 * T), (0.12, 1.2 * T), (0.32, T), (L, T))
"""Its step and kink lie between the hinges of 10 and of 20."""
DOUBLED = ((0.0, T), (0.1, T), (0.1, 1.3 * T), (0.3, 1.3 * T), (0.3, T), (L, T))


def sheet_of(profile: tuple[tuple[float, float], ...]) -> Sheet:
    return Sheet(**{**vars(STRIP), "thickness_m": mean_thickness(profile), "profile": profile})


def toml(profile: tuple[tuple[float, float], ...]) -> str:
    rows = ", ".join(f"{{ at_m = {s}, thickness_m = {t} }}" for s, t in profile)
    return f"sheet.profile=[{rows}]"


def toml8(profile: tuple[tuple[float, float], ...]) -> str:
    """Return the profile on the sheet of ``fig8``, twice as long and thick."""
    return toml(tuple((2.0 * s, 2.0 * t) for s, t in profile))


def compiled(sheet: Sheet, hinges: int) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_sheet(spec, sheet, StripConfig(hinges=hinges), np.zeros(3))
    return spec.compile()


@pytest.mark.parametrize("profile", [STEPPED, TAPERED], ids=["stepped", "tapered"])
@pytest.mark.parametrize("hinges", [10, 40])
def test_the_chain_has_the_sheets_mass_and_compliance(
    profile: tuple[tuple[float, float], ...], hinges: int
) -> None:
    sheet, model = sheet_of(profile), compiled(sheet_of(profile), hinges)
    # Analytic, whatever the division: ∫ ρ w t ds, ∫ ds/EI.
    assert model.body_mass.sum() == pytest.approx(sheet.mass_kg, rel=1e-12)
    stiffness = [model.joint(bend_joint(i)).stiffness[0] for i in range(hinges)]
    softness = L * sheet.mean(0.0, L, lambda part: 1.0 / part.bending_stiffness_nm2)
    # Discretisation: six Gauss points on the whole.
    assert np.sum(1.0 / np.array(stiffness)) == pytest.approx(softness, rel=1e-8)
    # The strip at the thicker end is heavier and its hinge stiffer.
    if profile is TAPERED:
        assert np.all(np.diff(stiffness) > 0.0)
        masses = [float(model.body(strip_body(i)).mass[0]) for i in range(1, hinges)]
        assert np.all(np.diff(masses) > 0.0)
        twists = [
            float(model.joint(twist_joint(i)).stiffness[0])
            for i in range(hinges)
            if any(model.joint(j).name == twist_joint(i) for j in range(model.njnt))
        ]
        assert np.all(np.diff(twists) > 0.0)


def test_a_profile_of_one_thickness_makes_the_chain_of_the_uniform_sheet() -> None:
    ours, theirs = compiled(sheet_of(((0.0, T), (0.1, T), (L, T))), 20), compiled(STRIP, 20)
    for field in ("body_mass", "body_inertia", "jnt_stiffness", "geom_size"):
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-12)
    np.testing.assert_allclose(ours.dof_damping, theirs.dof_damping, rtol=1e-12)


def test_the_strips_come_to_the_rod_with_the_square_of_their_number() -> None:
    """Discretisation: two independent models of one sheet, hanging between ideal grips."""
    sheet, path = sheet_of(ALIGNED), ExactPath(L, 0.9)
    alphas = np.array([0.5, 0.8])
    wanted = reference_loads(sheet, path, alphas, weight=True)
    gaps = []
    for hinges in (10, 20):
        found = settled_loads(sheet, hinges, path, alphas, weight=True)
        gaps.append(np.abs(found.force_n - wanted.force_n).max() / wanted.force_n.max())
        if hinges == 20:
            moment = np.abs(found.moment_nm - wanted.moment_nm).max()
            assert moment < 0.01 * sheet.bending_stiffness_nm2 / L
    assert gaps[1] < 0.01
    assert gaps[1] < 0.35 * gaps[0]  # a quarter, but for the third order


def short(*settings: str) -> RunRecord:
    quick = ("imperfections=none", "path.end_rad=0.5", "motion.speed_rad_per_s=0.25")
    return make_run(load_scenario("exact", [*quick, "motion.hold_s=0.3", *settings])).run()


@pytest.mark.parametrize(
    "setting",
    [toml(STEPPED), toml(DOUBLED), "sheet.rest_curvature_per_m=0.3"],
    ids=["stepped", "doubled", "curved"],
)
def test_the_reference_of_a_run_is_that_of_its_sheet(setting: str) -> None:
    run = short(setting)
    assert run.outcome == "completed"
    rows = np.flatnonzero(run["phase"] >= 1)[20::20]
    moment = run["left_true_moment_y"][rows]
    reference = reference_moments(run, "edge", rows)
    # Discretisation by 20 strips, and their swing: as on the uniform sheet.
    assert np.abs(reference - moment).max() < 0.03 * np.abs(moment).max()
    uniform = run.scenario.sheet.sheet()
    assert np.abs(moment).max() > 0.01 * uniform.bending_stiffness_nm2 / L
    # Both ends of it, which are not alike where the sheet is not.
    state = recorded_rods(run, "edge", rows)[-1]
    for side, load in (("left", state.left), ("right", state.right)):
        there = run[f"{side}_true_moment_y"][rows][-1]
        assert load.moment_nm == pytest.approx(there, abs=0.03 * np.abs(moment).max())
    # The moment in the hinge beside the grip goes on into the grip.
    beside = hinge_moments(run)[rows][-1, 0]
    section = uniform.section_at(L / 40)
    bend = state.curvature_per_m[2] + uniform.rest_curvature_per_m  # at L/40
    assert beside == pytest.approx(section.bending_stiffness_nm2 * bend, rel=0.05, abs=2e-4)
    assert any("the path is free of moments for a sheet of one" in w for w in run.summary.warnings)


def test_what_is_known_before_the_run_is_of_the_varied_sheet() -> None:
    plain = load_scenario("exact", ["imperfections=none"])
    curved = load_scenario("exact", ["imperfections=none", "sheet.rest_curvature_per_m=0.4"])
    EI = plain.sheet.sheet().bending_stiffness_nm2
    more = reference_on_path(curved).y - reference_on_path(plain).y
    np.testing.assert_allclose(more, 1e3 * 0.4 * EI, rtol=1e-4)  # analytic: EI κ₀
    extra = nominal_strain(curved) - nominal_strain(plain)
    # Where it bends most the path goes against the rest curvature: analytic, by κ₀ t/2.
    assert extra == pytest.approx(-0.4 * T / 2.0, rel=0.02)
    assert sheet_load(curved)[2] == pytest.approx(sheet_load(plain)[2] + 0.4 * EI)
    doubled = load_scenario("exact", [toml(DOUBLED)])
    thick = load_scenario("exact", [f"sheet.thickness_m={1.3 * T}"])
    assert sheet_load(doubled)[0] == pytest.approx(sheet_load(thick)[0])


def test_the_strain_of_a_run_is_that_of_the_thickness_where_it_bends() -> None:
    run = short(toml(DOUBLED))
    (row,) = np.flatnonzero(run["phase"] == 2)[:1]
    bends = np.abs(run.trace.bends[row]) * 20 / L
    thickness = run.scenario.sheet.sheet().thickness_at((np.arange(20) + 0.5) * L / 20)
    assert surface_strain(run)[row] == pytest.approx((bends * thickness / 2.0).max())


def test_the_strain_that_is_foreseen_is_that_of_the_run() -> None:
    run = short(toml(DOUBLED), "sheet.model.hinges=40")
    bends = run["phase"] >= 1
    # It is largest beside the step, where the sheet is thin: half a strip away it is 5 % less.
    assert surface_strain(run)[bends].max() == pytest.approx(nominal_strain(run.scenario), rel=0.07)


def test_the_reference_on_the_path_is_that_of_the_sensing_grip() -> None:
    """A symmetry: the sheet turned round, felt from the other side."""
    mirrored = tuple((L - s, t) for s, t in reversed(TAPERED))
    left, right = (
        reference_on_path(load_scenario("exact", [toml(profile), f'compliance.sensing=["{side}"]']))
        for profile, side in ((TAPERED, "left"), (mirrored, "right"))
    )
    np.testing.assert_allclose(left.y, right.y, rtol=1e-5, atol=1e-6)
    other = reference_on_path(load_scenario("exact", [toml(mirrored)]))
    assert np.abs(left.y - other.y).max() > 1.0  # mN m: the ends are not alike


def test_sheets_as_drawn_are_thicker_everywhere() -> None:
    config = load_scenario("exact", [toml(STEPPED)]).sheet
    true = config.sheet().thicker(1.1)
    drawn = with_true_numbers(config, true)
    assert drawn.sheet().bending_stiffness_nm2 == pytest.approx(true.bending_stiffness_nm2)
    assert drawn.sheet().profile == true.profile


def test_jaws_begin_as_open_as_the_thicker_end() -> None:
    cell = make_run(load_scenario("exact", ["imperfections=none", toml(TAPERED)])).cell
    cell.reset()
    model, data = cell.simulation.model, cell.simulation.data
    jaws = [model.joint(i) for i in range(model.njnt) if "jaw" in model.joint(i).name]
    assert jaws
    assert {float(data.qpos[j.qposadr[0]]) for j in jaws} == {1.2 * T / 2.0}


def test_the_true_sheet_is_thicker_everywhere_and_curved_by_both() -> None:
    found = load_scenario(
        "exact",
        [
            *("imperfections=none", toml(STEPPED), "sheet.rest_curvature_per_m=0.3"),
            *("imperfections.sheet.thickness_ratio=1.1", "imperfections.sheet.curvature_per_m=0.1"),
        ],
    )
    true, believed = found.true_sheet, found.sheet.sheet()
    assert true.rest_curvature_per_m == pytest.approx(0.4)
    np.testing.assert_allclose(
        [t for _, t in true.profile], [1.1 * t for _, t in believed.profile], rtol=1e-12
    )
    assert parse_scenario(found.to_toml(), "scenario.toml") == found


def test_the_loop_is_predicted_about_the_varied_sheet() -> None:
    settings = ["imperfections=none", "path.end_rad=0.5"]
    plain, doubled, tapered = (
        predict(load_scenario("fig8", [*settings, *more]))
        for more in ((), (toml8(DOUBLED),), (toml8(TAPERED),))
    )
    # A stiffer sheet takes gain margin; what is thinner and thicker by as much hardly changes it.
    assert doubled.rows[-1].gain_margin_db < plain.rows[-1].gain_margin_db - 0.3
    assert tapered.rows[-1].gain_margin_db == pytest.approx(plain.rows[-1].gain_margin_db, abs=1.0)


@pytest.mark.parametrize(
    ("scenario", "settings", "message"),
    [
        ("exact", [toml(DOUBLED), "sheet.thickness_m=0.001"], "thickness_m: the profile says the"),
        ("exact", [toml(DOUBLED), "sheet.plastic=true"], "plastic = true: a sheet of a profile"),
        ("exact", [toml(DOUBLED), "sheet.model=shell"], "profile: a shell is of one thickness"),
        (
            "exact",
            ["sheet.rest_curvature_per_m=0.1", "sheet.model=shell"],
            "rest_curvature_per_m: a shell is of one thickness and flat at rest",
        ),
        ("exact", [toml(DOUBLED), "sheet.length_m=0.5"], "must lead from 0 to the sheet's length"),
        ("exact", [toml(((0.0, T), (L, 9e-3)))], "is no thin sheet"),
        ("exact", [toml(((0.0, T), (L, 1.0)))], r"profile\[1\].thickness_m = 1"),
        ("pwb", ["sheet.rest_curvature_per_m=0.1"], "sheet.rest_curvature_per_m: an assembly is"),
    ],
)
def test_what_knows_uniform_sheets_alone_refuses_others(
    scenario: str, settings: list[str], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load_scenario(scenario, settings)


def test_a_setting_takes_a_profile_back() -> None:
    plain = load_scenario("exact")
    back = ["sheet.profile=none", f"sheet.thickness_m={T}"]
    assert load_scenario("exact", [toml(DOUBLED), *back]).sheet == plain.sheet


def test_a_compliance_that_knows_its_sheet_needs_one_alike_from_both_ends() -> None:
    modelled = ["imperfections=none", "path.end_rad=0.5"]
    with pytest.raises(InputError, match="alike from both ends"):
        make_run(load_scenario("tuned", [*modelled, toml(TAPERED)])).run()
