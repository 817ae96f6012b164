"""Contacts that no task intends: who collides, what is excluded, names in plain words, times."""

import itertools

import mujoco
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.contacts import HELD_M
from dualbend.types import Vector
from support.strip import STRIP6

HINGES = 20

# Grippers meet when the short sheet's ends turn towards each other: at some 1.5 rad.
NEAR = (
    "sheet.length_m=0.06",
    "sheet.thickness_m=0.0002",
    "cell.base_distance_m=0.6",
    "path.kind='exact'",
    "motion.speed_rad_per_s=0.5",
)


@pytest.fixture(scope="module")
def bending() -> Run:
    return make_run(load_scenario(STRIP6))


@pytest.fixture(scope="module")
def laying() -> Run:
    return make_run(load_scenario("pwb-stack"))


def touching(run: Run, **positions: Vector | float) -> set[str]:
    """Return the unintended contacts of the start with some joints elsewhere."""
    simulation = run.cell.simulation
    run.start()
    assert list(simulation.contacts) == []
    for joint, value in positions.items():
        start = simulation.model.joint(joint).qposadr[0]
        simulation.data.qpos[start : start + np.size(value)] = value
    mujoco.mj_forward(simulation.model, simulation.data)
    simulation.contacts.reset()
    return {str(contact) for contact in simulation.contacts}


def at(run: Run, geom: str) -> Vector:
    """Return where a shape is at the start (3,) [m]."""
    run.start()
    return np.array(run.cell.simulation.data.geom(geom).xpos)


# --- in pairs -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ("left_upper_arm_c", "the left arm's link2 touches the sheet"),
        ("right_wrist_c", "the right arm's link4 touches the sheet"),
        ("left_column_c", "the left arm's base touches the sheet"),
        ("right_palm_c", "the right arm's gripper touches the sheet"),
    ],
)
def test_a_sheet_laid_through_an_arm_touches_it(bending: Run, shape: str, said: str) -> None:
    assert said in touching(bending, sheet=at(bending, shape))


def test_the_sheet_touches_the_floor_from_half_its_thickness_down(bending: Run) -> None:
    half = bending.cell.sheet.thickness_m / 2
    # Exact: a flat sheet, clear of the arms; the bases are there too, 1 m to the sides.
    assert touching(bending, sheet=np.array([0.0, -1.0, half + 1e-6])) == set()
    assert touching(bending, sheet=np.array([0.0, -1.0, half - 1e-6])) == {
        "the sheet touches the floor"
    }


def test_an_arm_touches_the_floor_and_itself(bending: Run) -> None:
    # By the PUMA's size: the elbow 0.37 m above the floor, 0.43 m of forearm hanging from it.
    down = touching(bending, left_joint2=-np.pi / 4, left_joint3=-0.75 * np.pi)
    assert "the left arm's gripper touches the floor" in down
    # Past the elbow's range, where the forearm lies in the shoulder.
    folded = touching(bending, left_joint2=np.pi / 2, left_joint3=np.pi / 2)
    assert "the left arm's link1 touches the left arm's gripper" in folded


def test_an_arm_touches_bed_stand_and_pins(laying: Run) -> None:
    simulation = laying.cell.simulation
    laying.start()
    names = {simulation.contacts._names[i] for i in range(simulation.model.ngeom)}
    assert {"the bed", "the stand", "the middle left pin", "a laid sheet", "the floor"} <= names


def test_every_pair_touches_but_those_that_are_excluded(laying: Run) -> None:
    """By MuJoCo's rule; written down from the list of exclusions."""
    model = laying.cell.simulation.model
    kinds = {
        "link": "left_forearm_c",
        "first link": "left_shoulder_c",
        "other link": "right_forearm_c",
        "gripper": "left_palm_c",
        "other gripper": "right_palm_c",
        "middle": f"sheet_strip_{HINGES // 2:02d}_plate",
        "held": "sheet_strip_00_plate",
        "floor": "floor",
        "bed": "bed",
        "stand": "stand",
        "pin": "pin_outer_left",
    }
    geoms = {kind: model.geom(name).id for kind, name in kinds.items()}
    geoms["laid"] = next(
        i
        for i in np.flatnonzero(model.geom_group == 3).tolist()
        if model.body(model.geom_bodyid[i]).name == "laid_0_03"
    )
    apart = set()
    for one, other in itertools.combinations(geoms, 2):
        i, j = geoms[one], geoms[other]
        bits = model.geom_contype[i] & model.geom_conaffinity[j]
        bits |= model.geom_contype[j] & model.geom_conaffinity[i]
        if not bits:
            apart.add(frozenset((one, other)))
    still = ("floor", "bed", "stand", "pin", "laid")
    lies_on = itertools.product(("middle", "held"), ("bed", "stand", "laid"))
    excluded = [
        *itertools.combinations(still, 2),
        *lies_on,  # feet do
        ("middle", "held"),
        ("held", "gripper"),
        ("gripper", "laid"),
        ("other gripper", "laid"),
        ("first link", "floor"),
    ]
    assert apart == {frozenset(pair) for pair in excluded}


def test_an_end_is_clear_of_the_gripper_that_holds_it_and_of_no_other(bending: Run) -> None:
    model = bending.cell.simulation.model
    spacing = bending.scenario.sheet.length_m / HINGES
    mine, other = (model.geom(f"{side}_jaw_upper_c").conaffinity[0] for side in ("left", "right"))
    for strip in range(HINGES + 1):
        contype = model.geom(f"sheet_strip_{strip:02d}_plate").contype[0]
        nearest = max(0.0, (strip - 0.5) * spacing)
        assert bool(contype & mine) is (nearest >= HELD_M)
        assert bool(contype & other) is (spacing * (HINGES - strip - 0.5) >= HELD_M)


def test_intended_contacts_are_none(laying: Run) -> None:
    run = laying
    run.start()
    data = run.cell.simulation.data
    assert data.ncon > 0  # the sheet lies on the stand
    assert list(run.cell.simulation.contacts) == []


# --- over time ----------------------------------------------------------------------------------


def test_a_dropped_sheet_reaches_the_floor_when_free_fall_says(bending: Run) -> None:
    run = make_run(load_scenario(STRIP6))
    run.start()
    simulation, middle = run.cell.simulation, np.array([0.0, -1.0, 0.3])
    simulation.data.eq_active[:] = 0
    simulation.data.qpos[simulation.model.joint("sheet").qposadr[0] :][:3] = middle
    mujoco.mj_forward(simulation.model, simulation.data)
    rows = np.tile(simulation.q, (simulation.steps, 1))
    while not list(simulation.contacts) and simulation.data.time < 1.0:
        simulation.observe()
        simulation.advance(rows)
    (contact,) = simulation.contacts
    assert str(contact) == "the sheet touches the floor"
    # Analytic, limited by the step of 1.75 ms: t = sqrt(2 h / g).
    drop = middle[2] - run.cell.sheet.thickness_m / 2
    assert contact.time_s == pytest.approx(np.sqrt(2.0 * drop / 9.81), abs=2 * 0.00175)


def test_arms_that_touch_stop_and_both_are_named() -> None:
    result = make_run(
        load_scenario(
            STRIP6, [*NEAR, "path.start_rad=1.35", "path.end_rad=1.7", "guard.after_stop_s=0"]
        )
    ).run()
    assert result.outcome == "protective_stop"
    said = "the left arm's gripper touches the right arm's gripper"
    assert result.reason.startswith(said)
    (contact,) = result.contacts
    assert str(contact) == said
    # Within the cycle before the stop.
    assert 0.0 <= result.simulated_s - contact.time_s <= 0.028 + 1e-9
    metric = result.metrics["unintended_contacts"]
    assert (metric.value, metric.note) == (1.0, f"{said} at {contact.time_s:.3f} s")


def test_a_contact_may_be_recorded_alone() -> None:
    keys = ["path.start_rad=1.35", "path.end_rad=1.7", "guard.contact='record'"]
    loose = ["guard.torque_cycles=1000", "guard.following_error_rad=1"]
    result = make_run(load_scenario(STRIP6, [*NEAR, *keys, *loose])).run()
    assert "touches" not in result.reason
    assert result.metrics["unintended_contacts"].value == len(result.contacts) >= 1


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (["cell.sheet_height_m=0.03", "cell.base_height_m=0.03"], "link2 touches the floor"),
        ([*NEAR, "path.start_rad=1.8", "path.end_rad=1.84"], "touches the right arm's"),
    ],
)
def test_what_touches_at_the_start_is_refused(keys: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        make_run(load_scenario(STRIP6, keys))
    assert "cell.base_height_m" in str(refused.value)
