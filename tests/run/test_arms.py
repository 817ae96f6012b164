"""Runs on other arms: shortened here, in full length by ``dualbend validate --arm NAME``."""

import numpy as np
import pytest

from dualbend.arm.catalog import JOINT_COUNT
from dualbend.errors import InputError
from dualbend.run.arm_list import arm_table, evaluate_arms, table_markdown, table_text, verdict_text
from dualbend.run.arm_load import sheet_load
from dualbend.run.arms import arm_pair
from dualbend.run.known_sheet import known_sheet
from dualbend.scenario.load import load_scenario, parse_scenario
from dualbend.task.bending.run import BendingRun
from dualbend.validation.cases.runs import ik_residuals
from support.strip import STRIP6, STRIP8

SHORT = (
    "path.end_rad=0.2",
    "motion.speed_rad_per_s=0.4",
    "motion.hold_s=0.1",
    "motion.settle_s=0.3",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arms",
    [
        ("robot.model=ur5",),
        ("robot.model=ur10",),
        ("robot.model=panda",),
        ("robot.model=xarm7",),
        ("robot.left.model=puma560", "robot.right.model=ur5"),
    ],
)
def test_a_shortened_run_completes(arms: tuple[str, ...]) -> None:
    run = BendingRun(load_scenario(STRIP8, [*arms, *SHORT]))
    result = run.run()
    assert result.outcome == "completed", result.reason
    position, rotation = ik_residuals(result)
    assert position < 1e-6  # discretisation-limited: the solver's tolerance is 1e-7
    assert rotation < 1e-6
    columns = [name for name, _ in result.trace.columns if "_q_joint" in name]
    assert len(columns) == run.cell.arms.count
    # Both arms hold the sheet level, whatever they are: each carries half of its weight.
    weight = result.scenario.sheet.sheet().mass_kg * 9.81
    vertical = -(result.trace["left_true_force_z"] + result.trace["right_true_force_z"])
    settled = vertical[result.trace["phase"] == 0][-3:]
    # Analytic but for what still swings, of which the mean is taken.
    assert settled.mean() == pytest.approx(weight, rel=0.01)
    room = result.summary.to_json()["arms"]
    assert room["left"]["arm"] == run.cell.arms.left.model.name
    assert room["left"]["room_deg"] >= 5.0


def test_a_written_scenario_makes_the_run_again() -> None:
    result = BendingRun(load_scenario(STRIP6, ["robot.model=panda", *SHORT])).run()

    again = parse_scenario(result.scenario.to_toml(), "again")
    assert again == result.scenario
    second = BendingRun(again).run()
    np.testing.assert_array_equal(
        second.trace["left_true_moment_y"], result.trace["left_true_moment_y"]
    )


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["sheet.thickness_m=0.002"], r"panda_joint\d needs \d+\.\d N m, its limit is 12\.0"),
        (
            [
                *("sheet.thickness_m=0.0028", "sheet.young_pa=1e8", "sheet.width_m=0.3"),
                "sheet.density_kg_per_m3=25000",
            ],
            r"0\.85 kg and its share of the sheet 4\.20 kg are above its payload of 3 kg",
        ),
    ],
)
def test_an_arm_that_is_too_weak_is_refused_with_both_numbers(
    settings: list[str], words: str
) -> None:
    scenario = load_scenario(STRIP6, ["robot.model=panda", "sheet.width_m=0.4", *settings])
    with pytest.raises(InputError, match=words):
        BendingRun(scenario)


def test_the_load_is_what_the_sheet_asks_for() -> None:
    """Golden: the rod's first peak of 0.40 EI/L and up to 25 EI/L² on 0.2 rad."""
    scenario = load_scenario(STRIP6)
    sheet = scenario.sheet.sheet()
    force, weight, moment = sheet_load(scenario)
    unit = sheet.bending_stiffness_nm2 / sheet.length_m
    assert force * sheet.length_m / unit == pytest.approx(25.0, rel=0.06)
    assert moment / unit == pytest.approx(0.4, rel=0.02)
    assert weight == pytest.approx(0.5 * sheet.mass_kg * 9.81, rel=1e-3)


def test_the_load_of_a_table_is_that_of_its_straight_pieces() -> None:
    """Analytic: rows at the knots make the path of the pieces; a spline has no pieces."""
    pieces = load_scenario(STRIP6)
    path = pieces.path.make(pieces.sheet.length_m)
    rows = [[a, *path.at(a)] for a in path.knots.tolist()]
    said = f"kind='table', end_rad={pieces.path.end_rad}, table={rows}"
    straight = load_scenario(STRIP6, [f"path={{{said}}}"])
    np.testing.assert_allclose(sheet_load(straight), sheet_load(pieces), rtol=1e-12)
    smooth = load_scenario(STRIP6, [f"path={{{said}, smooth=true}}"])
    exact = load_scenario(STRIP6, ["path={kind='exact', end_rad=1.0}"])
    np.testing.assert_allclose(sheet_load(smooth), sheet_load(exact), rtol=1e-12)
    assert sheet_load(exact)[2] == 0.0


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("robot.model=ur55", r"robot\.model = 'ur55': must be one of .*'ur5'"),
        ("robot.right.model=puma", r"robot\.right\.model = 'puma': must be one of .*'puma560'"),
        ("cell.home_rad=[0,0,0,0,0,0,0]", r"cell\.home_rad has 7 values.*'puma560' has 6"),
    ],
)
def test_bad_arms_are_refused_with_the_choices(setting: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario(STRIP6, [setting])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        # Joint 4 of a Panda does not reach 0 (its data sheet: -3.0718 to -0.0698 rad).
        (
            ("robot.model=panda", "cell.home_rad=[0,0,0,0,0,0,0]"),
            r"cell\.home_rad\[3\] = 0: panda_joint4 of 'panda' goes from -3\.072 to -0\.0698 rad$",
        ),
        (
            ("robot.model=ur5", "cell.right.home_rad=[0,-90,90,0,90,0]"),
            r"cell\.right\.home_rad\[1\] = -90: .* if these are degrees: "
            r"cell\.right\.home_rad = \[0\.0, -1\.5708, 1\.5708, 0\.0, 1\.5708, 0\.0\]",
        ),
    ],
)
def test_a_home_pose_outside_a_joints_range_is_refused(
    settings: tuple[str, ...], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        arm_pair(load_scenario(STRIP6, settings))


def test_seven_stiffnesses_for_seven_joints() -> None:
    seven = "robot.servo.stiffness_n_m_per_rad=[1e4,1e4,1e4,1e4,2e3,2e3,2e3]"
    with pytest.raises(InputError, match=r"has 7 values, the left arm 'puma560' has 6 joints"):
        load_scenario(STRIP6, [seven])
    assert load_scenario(STRIP6, [seven, "robot.model=panda"]).robot.servo.stiffness_n_m_per_rad


def test_what_is_computed_of_one_arm_refuses_a_mixed_pair() -> None:
    with pytest.raises(InputError, match=r"two of a kind.*puma560 on the left and ur5"):
        known_sheet(load_scenario("tuned", ["robot.right.model=ur5"]))


def test_the_table_has_all_arms_with_their_ratings() -> None:
    rows = arm_table()
    assert [row["name"] for row in rows] == list(JOINT_COUNT)
    text, page = table_text(rows), table_markdown(rows)
    for row in rows:
        assert row["payload_kg"] > 0.0
        assert row["source"]
        assert row["grade"]
        assert row["name"] in text
        assert f"`{row['name']}`" in page


def test_each_arm_is_judged_in_a_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    from dualbend.run import arm_list

    monkeypatch.setattr(arm_list, "JOINT_COUNT", {"puma560": 6, "z1": 6})
    puma, z1 = evaluate_arms(STRIP6)
    assert puma["room"]["left"]["room_deg"] > 5.0
    assert "base 1.050 m behind" in verdict_text(puma)
    assert "misses one by" in verdict_text(z1)


def test_arms_that_stand_differently_are_judged_as_a_pair_of_one_kind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Analytic: an arm of one side gives way; the line has the left base and the worse room."""
    from dualbend.run import arm_list

    monkeypatch.setattr(arm_list, "JOINT_COUNT", {"ur5": 6})
    (row,) = evaluate_arms(STRIP6, ["robot.right.model=panda", "cell.left.base_height_m=0.6"])
    rooms = row["room"]
    assert [rooms[side]["arm"] for side in ("left", "right")] == ["ur5", "ur5"]
    assert row["cell"]["base_distance_m"] is None
    text = verdict_text(row)
    assert "left base" in text
    assert " 0.600 m up" in text
    worse = min(rooms["left"]["manipulability"], rooms["right"]["manipulability"])
    assert rooms["left"]["manipulability"] > worse + 0.01  # else the line would say nothing
    assert f"manipulability {worse:.2f}, " in text
    tight = min(rooms["left"]["room_deg"], rooms["right"]["room_deg"])
    assert f"{tight:.0f} degrees of room" in text
