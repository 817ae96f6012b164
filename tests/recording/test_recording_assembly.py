"""The recording of an assembly: bed, pins, holes, laid sheets, phases and contact are the run's."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_recording import ROUNDING_M, Recorded, rrd

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.recording.log import frame_cycles
from dualbend.recording.write import write_recording
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES, hole_places
from dualbend.scene.bed.mjcf import laid_body
from dualbend.scene.ik import carried_targets
from dualbend.scene.sheet.strips import strip_body
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.recording import (
    LAYERS,
    PHASE_COLOURS,
    carried,
    contact_force,
    places,
    supply_rows,
)
from dualbend.task.assembly.run import AssemblyRun
from support.made_up_book import LAID_M, LAID_YAW_RAD, ROWS_A_PHASE, make_book, stages

STAGES = stages()
SUPPLIED = ROWS_A_PHASE * (len(PHASES) + 2)
"""Row in which the second sheet is on the stand."""


@pytest.fixture(scope="module")
def book() -> tuple[AssemblyRun, RunRecord]:
    return make_book()


@pytest.fixture(scope="module")
def result(book: tuple[AssemblyRun, RunRecord]) -> RunRecord:
    return book[1]


@pytest.fixture(scope="module")
def path(result: RunRecord, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("recording") / "run.rrd"
    write_recording(result, target)
    return target


@pytest.fixture(scope="module")
def recorded(path: Path) -> Recorded:
    return Recorded(path)


def test_the_file_is_sound_and_its_columns_are_complete(recorded: Recorded, path: Path) -> None:
    verified = rrd("verify", str(path))
    assert verified.returncode == 0, verified.stderr
    assert recorded.has_layout
    moving = {"/pin_force", "/object_deviation", "/hole_offset", "/hole_height"}
    assert {f"/cell/hole/{hole}" for hole in HOLES} | {"/cell/sheet"} <= recorded.columns.keys()
    cycles = 28_000_000 * np.arange(len(STAGES))  # analytic: whole nanoseconds
    for entity in moving:
        np.testing.assert_array_equal(recorded.times_ns[entity], cycles, err_msg=entity)
    assert "/deviation" not in recorded.columns  # each arm's own compliance: there is none
    assert {f"/cell/pin/{hole}" for hole in HOLES} <= recorded.static.keys()
    assert "/cell/workplace" in recorded.static


def test_pins_stand_on_the_bed_as_high_as_they_are(recorded: Recorded, result: RunRecord) -> None:
    layout = result.scenario.task.layout
    for hole, place in zip(HOLES, hole_places(layout.holes), strict=True):
        pin = recorded.static[f"/cell/pin/{hole}"]
        foot = np.ravel(pin["Transform3D:translation"])
        np.testing.assert_allclose(foot, [*place, layout.bed.top_m], atol=1e-7)  # analytic
        # Radius and length of a capsule: its upper hemisphere ends at the pin's height.
        radius, length = (np.ravel(pin[f"Capsules3D:{k}"])[0] for k in ("radii", "lengths"))
        base = np.ravel(pin["Capsules3D:translations"])[2]
        assert base + length + radius == pytest.approx(layout.pins.height_m, rel=1e-6)


def test_a_tapered_pin_is_drawn_as_high_as_it_is(tmp_path: Path) -> None:
    _, result = make_book()
    tapered = make_run(load_scenario("pwb", ("task.layout.pins.tip=taper",))).cell.model
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    assert (tapered.geom_type == mesh).sum() == len(HOLES)
    from dualbend.recording.geometry import shapes_of

    (drawn,) = shapes_of(tapered, tapered.body("pin_outer_left").id)
    vertices = np.array(drawn.vertex_positions.as_arrow_array().to_pylist())
    pins = result.scenario.task.layout.pins
    # Analytic: foot on the bed, tip at the pin's height, as wide as it is.
    assert np.ptp(vertices[:, 2]) == pytest.approx(pins.height_m, rel=1e-5)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-8)
    assert np.hypot(*vertices[:, :2].T).max() == pytest.approx(pins.diameter_m / 2, rel=1e-5)


def test_holes_are_where_the_sheets_holes_are(recorded: Recorded, result: RunRecord) -> None:
    layout = result.scenario.task.layout
    shown = range(0, len(STAGES), frame_cycles(COMMAND_PERIOD_S))
    flat = [row for row in shown if not result.trace.bends[row].any()]
    assert flat
    turn = Rotation.from_euler("z", LAID_YAW_RAD)
    for hole, (along, across) in zip(HOLES, hole_places(layout.holes), strict=True):
        seen = np.array([recorded.pose(f"/cell/hole/{hole}", row)[1] for row in flat])
        # Analytic: a flat sheet's hole is at its arc length.
        expected = LAID_M + turn.apply([along, across, 0.0])
        np.testing.assert_allclose(seen, np.tile(expected, (len(flat), 1)), atol=ROUNDING_M)
        (radius,) = np.ravel(recorded.static[f"/cell/hole/{hole}"]["Cylinders3D:radii"])
        room = layout.holes.clearance_m
        # Discretisation: the ring of 32 sides has the circle's room on average, within 6 µm.
        assert 2.0 * radius - layout.pins.diameter_m == pytest.approx(room, abs=2.5e-5)


def test_a_laid_sheet_appears_when_the_next_is_supplied(
    recorded: Recorded, result: RunRecord
) -> None:
    np.testing.assert_array_equal(supply_rows(result), [SUPPLIED])
    (time,) = recorded.times_ns["/cell/laid/1"]
    assert time == 28_000_000 * SUPPLIED
    left = recorded("/cell/laid/1", "Mesh3D:vertex_positions")[0]
    before = np.flatnonzero(recorded.rows("/cell/sheet") < SUPPLIED)[-1]
    moving = recorded("/cell/sheet", "Mesh3D:vertex_positions")[before]
    np.testing.assert_array_equal(left, moving)  # exact: it stays where it was
    np.testing.assert_allclose(left.mean(axis=0), LAID_M, atol=1e-5)


def test_laid_plates_are_drawn_where_the_sheets_own_were(result: RunRecord) -> None:
    model = result.model
    data, before = mujoco.MjData(model), mujoco.MjData(model)
    LAYERS.pose_others(model, data, result, SUPPLIED - 1)
    assert (data.mocap_pos[:, 2] < -0.9).all()  # still hidden
    LAYERS.pose_others(model, data, result, SUPPLIED)
    mujoco.mj_forward(model, data)
    before.qpos[:] = result.trace.qpos[SUPPLIED - 1]
    mujoco.mj_forward(model, before)
    for i in range(result.scenario.sheet.strips.hinges + 1):
        plate = before.geom(f"{strip_body(i)}_plate")
        laid = model.body_geomadr[model.body(laid_body(0, i)).id]
        # Analytic: the same plate, of the same size.
        np.testing.assert_allclose(data.geom_xpos[laid], plate.xpos, atol=1e-12)
        np.testing.assert_allclose(data.geom_xmat[laid], plate.xmat, atol=1e-12)
        np.testing.assert_array_equal(model.geom_size[laid], model.geom(plate.id).size)


def test_phases_and_attempts_are_a_lane(recorded: Recorded) -> None:
    states = [state for (state,) in recorded.columns["/phase"]["StateChange:state"]]
    first = [*PHASES[:7], "lower 2", "seat middle 2", *PHASES[7:]]
    assert states == [*first, *PHASES, "aborted", ""]
    configured = recorded.static["/phase"]["StateConfiguration:values"]
    assert set(states) - {""} <= set(configured)
    colours = dict(
        zip(configured, recorded.static["/phase"]["StateConfiguration:colors"], strict=True)
    )
    assert all(colours[phase] == colour for phase, colour in PHASE_COLOURS.items())
    assert colours["lower 2"] == colours["lower"]
    names = [state for (state,) in recorded.columns["/sheet"]["StateChange:state"]]
    assert names == ["1 of 2", "2 of 2", ""]
    times = recorded.times_ns["/sheet"]
    np.testing.assert_array_equal(times, 28_000_000 * np.array([0, SUPPLIED, len(STAGES)]))


def test_commanded_grips_are_carried_as_the_ik_carries_them(
    recorded: Recorded, result: RunRecord
) -> None:
    trace = result.trace
    sent = carried(trace, places(trace), result.scenario.robot.alter.delay_cycles)
    for row in (
        0,
        2 * frame_cycles(COMMAND_PERIOD_S),
        (len(STAGES) - 2) // frame_cycles(COMMAND_PERIOD_S) * frame_cycles(COMMAND_PERIOD_S),
    ):
        pose = np.array(
            [
                [trace[f"{s}_command_{a}"][row] for a in ("x", "z", "alpha")]
                for s in ("left", "right")
            ]
        )
        for side, target in zip(("left", "right"), carried_targets(pose, sent[row]), strict=True):
            turn, place = recorded.pose(f"/cell/grip/{side}_commanded", row)
            np.testing.assert_allclose(place, target.translation(), atol=ROUNDING_M)
            matrix = target.rotation().as_matrix()
            np.testing.assert_allclose(turn.as_matrix(), matrix, atol=4e-6)  # rounded to 1e-6


def test_the_compliance_is_sent_as_late_as_the_robot_takes_it(result: RunRecord) -> None:
    trace, delay = result.trace, result.scenario.robot.alter.delay_cycles
    late = (carried(trace, places(trace), delay) - places(trace))[:, [0, 1, 3]]
    given = np.stack([trace[f"object_deviation_{a}"] for a in ("x", "y", "yaw")], axis=1)
    assert delay == 2
    np.testing.assert_allclose(late[delay:], given[:-delay], atol=1e-15)  # analytic
    np.testing.assert_array_equal(late[:delay], 0.0)


def test_contact_is_what_the_arms_feel_beside_the_weight(result: RunRecord) -> None:
    trace = result.trace
    rows = np.array([phase for _, phase, _ in STAGES])
    sheets = np.array([sheet for sheet, _, _ in STAGES])
    generator = np.random.default_rng(5)
    contact = generator.standard_normal((len(STAGES), 3))
    contact[rows == "bend"] = 0.0
    for sheet, weight in ((0, -0.3), (1, -0.4)):
        for i, axis in enumerate("xyz"):
            carried_n = weight if axis == "z" else 0.01
            here = sheets == sheet
            trace[f"net_force_{axis}"][here] = contact[here, i] + carried_n
    seen = contact_force(trace, COMMAND_PERIOD_S)
    down = np.isin(rows, PHASES[PHASES.index("lower") : PHASES.index("release")])
    np.testing.assert_allclose(seen[down], contact[down], atol=1e-14)  # analytic
    assert np.isnan(seen[~down]).all()


def test_lines_of_contact_end_where_there_is_none(recorded: Recorded) -> None:
    _, result = make_book()  # as it was recorded
    force = contact_force(result.trace, COMMAND_PERIOD_S)
    values = recorded.columns["/contact_force"]["Scalars:scalars"]
    lengths = np.array([len(value) for value in values])
    there = recorded.rows("/contact_force")
    finite = np.isfinite(force).all(axis=1)
    np.testing.assert_array_equal(there[lengths == 3], np.flatnonzero(finite))  # analytic
    # A row without a value after each stretch; NaN would equal no NaN in another recording.
    ends = 1 + np.flatnonzero(finite[:-1] & ~finite[1:])
    np.testing.assert_array_equal(there[lengths == 0], ends)
    shown = np.array([value for value in values if value])
    np.testing.assert_array_equal(shown, force[finite])


def test_plots_of_holes_and_pins_are_the_traces(recorded: Recorded, result: RunRecord) -> None:
    trace = result.trace
    forces = np.stack([trace[f"pin_force_{hole}"] for hole in HOLES], axis=1)
    np.testing.assert_array_equal(recorded("/pin_force", "Scalars:scalars"), forces)  # a copy
    away = [1e3 * np.hypot(trace[f"hole_{h}_x"], trace[f"hole_{h}_y"]) for h in HOLES]
    offsets = recorded("/hole_offset", "Scalars:scalars")
    np.testing.assert_allclose(offsets, np.stack(away, axis=1), rtol=1e-12)
    for entity in ("/pin_force", "/hole_offset", "/contact_force", "/object_deviation"):
        labels = recorded.static[entity]["SeriesLines:names"]
        assert all(label.endswith("]") for label in labels)


@pytest.mark.parametrize("rows", [0, 1, 2, 40])
def test_an_assembly_that_stopped_is_recorded_up_to_its_stop(tmp_path: Path, rows: int) -> None:
    _, result = make_book()
    result.trace.rows = rows
    if rows:
        for name in ("attempt", "sheet", "place_x", "net_force_x", "left_command_x"):
            result.trace[name][-1] = np.nan  # observed, then stopped before anything was noted
    target = tmp_path / "stopped.rrd"
    write_recording(result, target)
    verified = rrd("verify", str(target))
    assert verified.returncode == 0, verified.stderr
    *_, outcome, reset = Recorded(target).columns["/phase"]["StateChange:state"]
    assert (outcome, reset) == (["aborted"], [""])
