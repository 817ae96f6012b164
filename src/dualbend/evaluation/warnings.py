"""Where a run contradicts physics, or what it is for: what to say, each in one sentence.

Some are known before the run, from its scenario, the others after it, from its record.
"""

from __future__ import annotations

import numpy as np

from dualbend.beam.material import Material, library
from dualbend.control.guard import SENSOR_AXES
from dualbend.evaluation.metrics import peak, surface_strain
from dualbend.evaluation.sheet import SheetReport, sheet_report
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import SheetConfig, named_material
from dualbend.scenario.toml_text import number
from dualbend.types import SIDES, Mask, Side, Vector

_SCATTER = {
    "young_pa": 0.1,
    "poisson_ratio": 0.1,
    "density_kg_per_m3": 0.1,
    "yield_pa": 0.25,
}
"""By how much the numbers of one material differ, relative: the sources of the library are within.

Its moduli by up to 8 % (copper foil, 110 to 130 GPa), its strengths by up to 19 % (1100-H14, 95 to
125 MPa); the copper foil's strength, which depends on its annealing, is the exception.
"""


def scenario_warnings(scenario: Scenario) -> list[str]:
    """Return what is known before a run: a name beside other numbers, a sheet that yields."""
    sheet, report = scenario.sheet, sheet_report(scenario)
    return [
        *name_warnings(sheet),
        *_path_warnings(scenario),
        *_strain_warnings(sheet, report, report.nominal_strain, "on the nominal path"),
    ]


def run_warnings(run: RunRecord) -> list[str]:
    """Return what is known after a run: of its sheet, its sensors, its compliance."""
    found = [*_saturated_sensors(run), *_lost_sensors(run), *_late_compliance(run)]
    sheet, report = run.scenario.sheet, sheet_report(run.scenario)
    if not _strain_warnings(sheet, report, report.nominal_strain, ""):
        strain = peak(surface_strain(run))
        found = [*_strain_warnings(sheet, report, strain, "in the run"), *found]
    return found


def _path_warnings(scenario: Scenario) -> list[str]:
    """Return what to say where the path is that of another sheet: uniform, and flat at rest."""
    if scenario.sheet.sheet().is_plain or scenario.path.kind == "table":
        return []
    return [
        "the path is free of moments for a sheet of one thickness that is flat at rest; this sheet "
        'has moments on it even in grips that follow it: path = "table" can hold a path of its own'
    ]


def name_warnings(sheet: SheetConfig) -> list[str]:
    """Return what to say where a material's name stands beside numbers that are another's."""
    if sheet.material is None:
        return []
    named = named_material(sheet)
    differing = [
        f"sheet.{key} = {number(getattr(sheet, key))} ({sheet.material}: {number(own)})"
        for key, own in _differing(sheet, named).items()
    ]
    if not differing:
        return []
    return [
        f'sheet.material = "{sheet.material}" stands beside numbers of another material, which '
        f"count: {', '.join(differing)}"
    ]


def _differing(sheet: SheetConfig, material: Material) -> dict[str, float]:
    """Return the material's own numbers from which the sheet's given ones are too far."""
    own = {key: getattr(material, key) for key in _SCATTER}
    return {
        key: value
        for key, value in own.items()
        if (given := getattr(sheet, key)) is not None
        and value is not None
        and abs(given - value) > _SCATTER[key] * value
    }


def _strain_warnings(
    sheet: SheetConfig, report: SheetReport, strain: float | None, where: str
) -> list[str]:
    """Return what to say of a largest surface strain ``where``.

    Nothing below the sheet's limit, and of a sheet that is simulated to yield.
    """
    if strain is None:
        return []
    if report.limit_strain is None:
        return _unnamed(sheet, strain, where)
    if strain <= report.limit_strain or report.plastic:
        return []
    yields, breaks = (
        ("yields", "it is simulated elastic, set sheet.plastic = true for a permanent set"),
        ("breaks", "it is simulated as if it did not"),
    )
    happens, simulated = yields if report.yields else breaks
    return [
        f"the sheet ({report.material}) {happens}: its surface strain reaches {strain:.2e} "
        f"{where}, above {report.limit_strain:.2e}; {simulated}"
    ]


def _unnamed(sheet: SheetConfig, strain: float, where: str) -> list[str]:
    """Return what to say of a sheet whose limit is not known: what materials like it bear.

    Where the library has none like it: that none of all bears so much.
    """
    limits = {m: m.limit_strain for m in library().values() if m.limit_strain is not None}
    alike = {m.name: limit for m, limit in limits.items() if not _differing(sheet, m)}
    exceeded = [f"{name} bears {limit:.2e}" for name, limit in alike.items() if strain > limit]
    bears = f"of the materials with its numbers {', '.join(exceeded)}"
    if not alike:
        most = max(limits, key=lambda material: limits[material])
        exceeded = [most.name] if strain > limits[most] else []
        bears = f"no material of the library bears more than {limits[most]:.2e} ({most.name})"
    if not exceeded:
        return []
    return [
        f"the sheet may yield or break: its surface strain reaches {strain:.2e} {where}, and "
        f"neither sheet.material nor sheet.yield_pa says what it bears; {bears}"
    ]


def _saturated_sensors(run: RunRecord) -> list[str]:
    """Return what to say of each sensor that was at the end of its range."""
    found = []
    force, torque = run.scenario.sensor.full_scale
    for side in _sensing(run):
        at_end = _at_range_end(run, side)
        cycles, axes = np.any(at_end, axis=1), np.array(SENSOR_AXES)[np.any(at_end, axis=0)]
        if axes.size:
            found.append(
                f"the {side} sensor was at the end of its range (±{force:g} N, ±{torque:g} N m) in "
                f"{np.count_nonzero(cycles)} of {len(cycles)} cycles, at most {_in_a_row(cycles)} "
                f"in a row ({', '.join(axes)}): it read less than acted"
            )
    return found


def _lost_sensors(run: RunRecord) -> list[str]:
    """Return what to say of each sensor that told its last reading again.

    Only of one that may do so in the scenario, and has the noise by which it is noticed.
    """
    errors = run.scenario.imperfections.sensor
    found = []
    for side in _sensing(run):
        if run.scenario.sensor.may_repeat or not (errors.dropout_probability or errors.stuck):
            continue
        readings = _readings(run, side)
        again = np.all(readings[1:] == readings[:-1], axis=1)
        if again.any():
            found.append(
                f"the {side} sensor told nothing new in {np.count_nonzero(again)} of "
                f"{len(readings)} cycles, at most {_in_a_row(again)} in a row"
            )
    return found


def _sensing(run: RunRecord) -> list[Side]:
    return [side for side in SIDES if side in run.scenario.compliance.sensing]


def _readings(run: RunRecord, side: Side) -> Vector:
    """Return what a sensor read, in the cycles that it was read in (n, 6)."""
    names = [f"{side}_sensor_{axis.replace(' ', '_')}" for axis in SENSOR_AXES]
    readings = np.stack([run[name] for name in names], axis=1)
    return readings[~np.isnan(readings).any(axis=1)]


def _at_range_end(run: RunRecord, side: Side) -> Mask:
    """Return which axes of a sensor read full scale, in the cycles that it was read in (n, 6)."""
    full = np.repeat(run.scenario.sensor.full_scale, 3)
    return np.asarray(np.abs(_readings(run, side)) >= full * (1.0 - 1e-9))


def _in_a_row(cycles: Mask) -> int:
    """Return the longest run of true values (rows,)."""
    ends = np.flatnonzero(np.diff(cycles.astype(int), prepend=0, append=0))
    return int(np.max(ends[1::2] - ends[::2], initial=0))


def _late_compliance(run: RunRecord) -> list[str]:
    """Return what to say where no arm had complied yet when the bending moment was largest."""
    compliance = run.scenario.compliance
    deviations = np.stack(
        [run[f"{side}_deviation_{part}"] for side in SIDES for part in ("x", "alpha")]
    )
    acts: Mask = np.any(np.nan_to_num(deviations) != 0.0, axis=0)
    if "bend" not in run.phases or not (acts.any() or compliance.x or compliance.rotation):
        return []
    moment: Vector = np.abs(run[f"{run.sensing_side}_true_moment_y"])
    moment = np.where(run["phase"] == run.phases.index("bend"), np.nan_to_num(moment), 0.0)
    if not moment.any():
        return []
    largest, alpha = int(np.argmax(moment)), run["nominal_alpha"]
    if acts[: largest + 1].any():
        return []
    peak_moment = f"{moment[largest]:.3g} N m at {alpha[largest]:.3f} rad"
    if not acts.any():
        return [f"the compliance moved no arm: it did not reduce the largest moment, {peak_moment}"]
    return [
        f"the compliance began at {alpha[np.argmax(acts)]:.3f} rad, after the largest moment, "
        f"{peak_moment}: it could not reduce it"
    ]
