"""Which runs can be one batch: their structure is one, their numbers may differ."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable

import msgspec

from dualbend.imperfection.sensor import SensorErrors
from dualbend.run.loop import Run
from dualbend.scene.sheet.strips import StripConfig
from dualbend.task.bending.rehearsal import Rehearsal
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES

_SIZES = ("nq", "nv", "nu", "nbody", "njnt", "ngeom", "nsite", "nsensordata", "neq", "ntendon")
_ALIKE = ("sampling_ms", "latency_ms", "force_resolution_n", "torque_resolution_nm")
"""Of [sensor]: when samples are taken, which channels have counts, whether readings may repeat."""


def alone(run: Run) -> str:
    """Return why a run cannot be one of a batch, in words; "" where it can."""
    scenario = run.scenario
    if not isinstance(run, BendingRun) or type(run) not in (BendingRun, Rehearsal):
        return "its program decides in each cycle where it goes"
    if run.nominal_q is None:
        return "mink solves each cycle of an arm that has not six joints"
    if not isinstance(scenario.sheet.model, StripConfig):
        return "a shell's shape is measured on its own"
    if scenario.grasp.friction is not None:
        return "a sheet that may slide moves the model between physics steps"
    events = scenario.imperfections.events
    if events.arm_stop is not None or events.grips:
        return "an event is to happen"
    return ""


def structure(run: BendingRun) -> Hashable:
    """Return what runs of one batch have in common."""
    scenario, model = run.scenario, run.cell.compiled
    robot, errors = scenario.robot, scenario.imperfections
    sensor = scenario.sensor
    sections = (
        *(scenario.filter, scenario.guard, scenario.grasp, robot.servo, robot.alter.mode),
        *(robot.response_of(side) for side in SIDES),
        *(getattr(sensor, name) for name in _ALIKE),
    )
    numbers = (
        *(getattr(model, name) for name in _SIZES),
        *(model.opt.timestep, model.opt.disableflags, scenario.period_s),
        *(
            sensor.may_repeat,
            sensor.calibration is None,
            scenario.compliance.tare,
            scenario.compliance.in_space,
        ),
        *(errors.link.errs, errors.robot.displaces, errors.robot.weighs_wrong),
        *(errors.robot.stiction_excess > 0.0, run.grip_errors is not None),
        errors.sensor == SensorErrors(),
        run.free,
        *(scenario.compliance.sensing, scenario.compliance.complying),
    )
    arms = run.cell.simulation.joint_range, run.cell.simulation.torque_limit
    return (
        msgspec.json.encode(sections),
        numbers,
        tuple(run.cell.simulation.joints),
        *(array.tobytes() for array in (*arms, run.cell.arms.speed_limit)),
        model.names,
    )


def grouped(runs: Iterable[Run], largest: int) -> list[list[int]]:
    """Return the numbers of runs that go together, those that go alone by themselves."""
    groups: defaultdict[Hashable, list[int]] = defaultdict(list)
    for index, run in enumerate(runs):
        if isinstance(run, BendingRun) and not alone(run):
            groups[structure(run)].append(index)
        else:
            groups["alone", index].append(index)
    return [
        group[first : first + largest]
        for group in groups.values()
        for first in range(0, len(group), largest)
    ]
