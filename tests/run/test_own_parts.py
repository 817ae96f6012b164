"""What a user brings along: a path as a table, a compliance in Python, results from a script."""

from pathlib import Path

import numpy as np
import pytest

from dualbend import (
    Observation,
    load_run,
    load_scenario,
    write_results,
)
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance
from dualbend.control.compliance.pair import PairCompliance
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.task.bending import metrics as bending_metrics
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector
from support.strip import STRIP6, STRIP8

SHORT = ("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "sheet.model.hinges=10")


def short(name: str = "fig6", *settings: str) -> Scenario:
    return load_scenario(name, [*SHORT, "motion.hold_s=0.1", *settings])


class Still:
    """Complies with nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def __call__(self, observation: Observation) -> Vector:
        return np.zeros((2, 6))


def papers_own(scenario: Scenario) -> PairCompliance:
    admittance = Admittance(scenario.compliance, period_s=COMMAND_PERIOD_S, shape=(1,))
    return PairCompliance(admittance, sensing=[0], complying=[0])


def columns(run: BendingRun) -> Vector:
    trace = run.run().trace
    return np.column_stack([trace["left_true_moment_y"], trace["left_deviation_x"], trace["sag"]])


def test_a_compliance_that_does_nothing_makes_the_run_without_one() -> None:
    # Golden to the bit: the same commands.
    np.testing.assert_array_equal(
        columns(make_run(short(STRIP8), compliance=Still)),
        columns(BendingRun(short(STRIP8, "compliance.x=none", "compliance.rotation=none"))),
    )


def test_the_papers_compliance_brought_along_is_the_scenarios() -> None:
    settings = ("compliance.x.from_alpha_rad=0.05",)
    own = columns(make_run(short(STRIP8, *settings), compliance=papers_own))
    np.testing.assert_array_equal(own, columns(BendingRun(short(STRIP8, *settings))))
    assert np.abs(own[:, 1]).max() > 1e-5


class Listener(Still):
    """Remembers what it was told."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.told: list[Observation] = []

    def __call__(self, observation: Observation) -> Vector:
        self.told.append(observation)
        return super().__call__(observation)


def test_a_controller_is_told_what_the_trace_records() -> None:
    made = list[Listener]()

    def make(scenario: Scenario) -> Listener:
        made.append(Listener(scenario))
        return made[-1]

    run = make_run(short(STRIP8, 'compliance.sensing=["left","right"]'), compliance=make)
    result = run.run()
    trace, told = result.trace, made[0].told
    assert len(made) == 1
    assert len(told) == trace.rows

    def column(name: str) -> Vector:
        return np.asarray(trace[name])

    assert [result.phases.index(o.phase) for o in told] == column("phase").tolist()
    np.testing.assert_array_equal([o.time_s for o in told], column("time"))
    for i, side in enumerate(("left", "right")):
        expected = {
            "measured_force_x": [o.raw.force_n[i, 0] for o in told],
            "measured_moment_y": [o.raw.torque_nm[i, 1] for o in told],
            "filtered_force_x": [o.filtered.force_n[i, 0] for o in told],
            "filtered_moment_y": [o.filtered.torque_nm[i, 1] for o in told],
            "grip_x": [o.measured.x_m[i] for o in told],
            "grip_alpha": [o.measured.alpha_rad[i] for o in told],
            "q_joint2": [o.joints_rad[6 * i + 1] for o in told],
        }
        for name, values in expected.items():
            np.testing.assert_array_equal(values, column(f"{side}_{name}"), err_msg=name)
        np.testing.assert_array_equal(
            [o.nominal.alpha_rad[i] for o in told], column("nominal_alpha")
        )
        np.testing.assert_array_equal(
            [-o.nominal.x_m[i] for o in told], column("nominal_half_distance")
        )


def test_a_run_says_whose_compliance_it_had(tmp_path: Path) -> None:
    result = make_run(short(), compliance=Still).run()
    assert result.controller.endswith("test_own_parts.Still")
    assert write_results(result, tmp_path, record=False) == []
    assert load_run(tmp_path).summary.controller == result.controller
    plain = BendingRun(short()).run()
    assert plain.controller == ""
    assert "controller" not in plain.summary.to_json()


def test_the_numbers_are_computed_once_for_summary_and_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = list[RunRecord]()
    real = bending_metrics.metrics

    def counted(record: RunRecord) -> dict[str, Metric]:
        calls.append(record)
        return real(record)

    monkeypatch.setattr(bending_metrics, "metrics", counted)
    result = BendingRun(short()).run()
    assert write_results(result, tmp_path) == []
    assert calls == [result]


def test_a_table_of_the_knots_makes_the_run_of_the_pieces() -> None:
    scenario = short()
    path = scenario.path.make(scenario.sheet.length_m)
    rows = [[a, *path.at(a)] for a in path.knots.tolist()]
    table = load_scenario(
        "fig6", [*SHORT, "motion.hold_s=0.1", f"path={{kind='table',end_rad=0.2,table={rows}}}"]
    )
    np.testing.assert_array_equal(columns(BendingRun(table)), columns(BendingRun(scenario)))


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("path.kind=table", '`table`, as kind = "table" needs'),
        ("path={kind='exact',smooth=true}", 'smooth = True: belongs to kind = "table"'),
        ("path.table=[[0,0.2,0],[1,0.1,0.1]]", 'belongs to kind = "table", this path is "piece'),
    ],
)
def test_a_table_without_its_kind_is_refused(setting: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        load_scenario(STRIP6, [setting])


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ("[[0,0.4,0],[1,0.35,0.1]]", "path.table, row 1: half distance = 0.4 m"),
        ("[[0,0.2,0],[0.5,0.19,0.1]]", "path.start_rad = 0 and end_rad = 1"),
        ("[[0,0.2,0],[0,0.19,0.1]]", "path.table: α must grow"),
    ],
)
def test_a_table_that_does_not_suit_the_sheet_is_refused_when_it_is_read(
    table: str, text: str
) -> None:
    with pytest.raises(InputError, match=rf"fig6\.toml with --set: {text}"):
        load_scenario(STRIP6, [f"path={{kind='table',table={table}}}"])
