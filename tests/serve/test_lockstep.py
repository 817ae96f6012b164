"""Lock step: a controller in a process of its own makes the trace of the built-in one."""

import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
import pytest

from dualbend import load_scenario, make_run, open_cell
from dualbend.run.cell import believed_tool
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.types import SIDES
from support.served import controllers, example_client, served

SHORT = ("motion.speed_rad_per_s=1.0", "path.end_rad=0.3", "motion.hold_s=0.1")


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(load_scenario("fig8", SHORT))


def tools(run: Run) -> list[tuple[float, ...]]:
    model, told = run.cell.simulation.model, []
    for side in SIDES:
        mass_kg, centre_m = believed_tool(run.scenario, model, side)
        told.append((mass_kg, float(centre_m[0]), float(centre_m[2])))
    return told


def by_example(run: Run) -> RunRecord:
    with served(run) as (cell, go), example_client(cell, tools(run)):
        return go()


def repeated(correction: str) -> Callable[[bytes], list[bytes]]:
    """Return what answers each telegram with the same correction."""

    def answer(telegram: bytes) -> list[bytes]:
        ipoc = telegram.partition(b"<IPOC>")[2].partition(b"<")[0].decode()
        return [f"<Sen><RKorr {correction}/><IPOC>{ipoc}</IPOC></Sen>".encode()]

    return answer


@pytest.fixture(scope="module")
def by_client(run: Run) -> RunRecord:
    return by_example(run)


def test_the_example_client_makes_the_built_in_controllers_trace(
    run: Run, by_client: RunRecord
) -> None:
    """Cycle by cycle: one cycle of delay more would be some 100 mN m here.

    Where RIst took the place of RRead, the pose when the reading was taken, it would be 0.01 mN m.
    """
    built_in = run.run()
    assert by_client.outcome == built_in.outcome == "completed"
    for side in SIDES:
        name = f"{side}_true_moment_y"
        difference = np.abs(by_client[name] - built_in[name])
        assert np.max(difference) < 1e-7  # of the six decimals on the wire
        assert np.max(np.abs(np.diff(built_in[name]))) > 5e-3
    assert by_client.controller == "dualbend serve"


def test_lock_step_twice_is_one_trace_bit_for_bit(run: Run, by_client: RunRecord) -> None:
    again = by_example(run)
    for name, _ in again.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(again[name], by_client[name], err_msg=name)


def test_each_cycle_is_asked_and_answered_once(by_client: RunRecord) -> None:
    rows = by_client.trace.rows
    counts = {row["port"]: row for row in by_client.ports}
    for side in SIDES:
        assert counts[f"{side} robot"]["answered"] == rows
        assert counts[f"{side} robot"]["wrong_ipoc"] == 0
        assert counts[f"{side} sensor"]["requests"] == 1
    assert by_client.summary.tables["ports"] == list(by_client.ports)


def test_a_correction_is_the_deviation_of_its_own_arm(run: Run) -> None:
    """X in mm, B in degrees; the left arm's and the right one's are not mixed up."""
    with (
        served(run) as (cell, go),
        controllers(cell, repeated('X="0.02" B="0.25"'), repeated('X="0" Z="-0.01"')),
    ):
        record = go()
    assert record.outcome == "completed", record.reason
    assert np.all(record["left_deviation_x"] == 0.02e-3)
    assert np.all(record["left_deviation_alpha"] == np.radians(0.25))
    assert np.all(record["right_deviation_x"] == 0.0)
    assert np.all(record["right_deviation_alpha"] == 0.0)


def test_relative_corrections_add_up(run: Run) -> None:
    with (
        served(run, correction="relative") as (cell, go),
        controllers(cell, repeated('B="0.001"'), repeated("")),
    ):
        record = go()
    wanted = np.radians(0.001) * np.arange(1, record.trace.rows + 1)
    np.testing.assert_allclose(record["left_deviation_alpha"], wanted, rtol=1e-12)
    assert np.all(record["right_deviation_alpha"] == 0.0)


def test_a_step_is_the_change_from_cycle_to_cycle(run: Run) -> None:
    """A slow ramp goes far beyond what one cycle may change."""
    cycles: list[bytes] = []

    def ramp(telegram: bytes) -> list[bytes]:
        cycles.append(telegram)
        return repeated(f'B="{0.001 * len(cycles)}"')(telegram)

    with served(run, step_rad=2e-5) as (cell, go), controllers(cell, ramp, repeated("")):
        record = go()
    assert record.outcome == "completed", record.reason
    assert record["left_deviation_alpha"][-1] > 20 * 2e-5


def test_a_telegram_tells_what_a_stepped_cell_observes(run: Run) -> None:
    """The same deviations by Cell.step; six decimals of mm and degrees are told."""
    telegrams: list[ET.Element] = []

    def noted(telegram: bytes) -> list[bytes]:
        telegrams.append(ET.fromstring(telegram))
        return repeated('Y="0.01" A="0.02" B="0.25"')(telegram)

    with served(run) as (cell, go), controllers(cell, noted, repeated("")):
        go()
    left = np.zeros((2, 6))
    left[0] = [0.0, 1e-5, 0.0, 0.0, np.radians(0.25), np.radians(0.02)]
    with open_cell(run.scenario) as stepped:
        observed = stepped.reset()
        for telegram in telegrams:
            x, z, alpha = observed.measured.coordinates[0]
            y, roll, yaw = observed.aside[0]
            # KUKA's angles are in another order: for small yaw and roll, to first order.
            turns = np.degrees([yaw + roll * np.tan(alpha), alpha, roll / np.cos(alpha)])
            wanted = [1e3 * x, 1e3 * y, 1e3 * z, *turns]
            np.testing.assert_allclose(numbers(telegram, "RIst"), wanted, atol=2e-6)
            x, z, alpha = observed.nominal.coordinates[0]
            wanted = [1e3 * x, 0.0, 1e3 * z, 0.0, np.degrees(alpha), 0.0]
            np.testing.assert_allclose(numbers(telegram, "RSol"), wanted, atol=1e-6)
            joints = np.degrees(observed.joints_rad[:6])
            np.testing.assert_allclose(numbers(telegram, "AIPos"), joints, atol=1e-6)
            observed = stepped.step(left)
        assert stepped.done
    told = np.array([numbers(telegram, "RIst") for telegram in telegrams])
    assert np.all(np.ptp(told, axis=0)[:5] > 3e-3)  # also out of the plane


def numbers(telegram: ET.Element, name: str) -> list[float]:
    element = telegram.find(name)
    assert element is not None
    return [float(value) for value in element.attrib.values()]
