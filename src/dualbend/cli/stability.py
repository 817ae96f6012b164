"""Commands that predict the admittance loop before a run: stability, tune."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from dualbend.cli.common import (
    EXIT_FAILED_CHECK,
    JSON,
    PATH,
    SCENARIO,
    SETTINGS,
    Number,
    command,
    load,
    print_json,
    progress_bar,
)
from dualbend.errors import InputError

_FACTOR = Number(1e-9, 1e9)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dualbend.control.compliance.admittance import ComplianceConfig
    from dualbend.control.compliance.base import AxisConfig
    from dualbend.imperfection.config import PresetName
    from dualbend.scenario.scenario import Scenario
    from dualbend.stability.prediction import Prediction, Row
    from dualbend.study.tuning.search import Margin
    from dualbend.study.tuning.tuning import Tuning


@command("dualbend stability fig9 --map fig9.png")
@SCENARIO
@click.option(
    "--axis",
    type=click.Choice(["x", "rotation", "coupled"]),
    default="coupled",
    help="Axes that are included.",
)
@click.option("--map", "map_file", type=PATH, help="PNG of the stable region in (b, k).")
@click.option(
    "--map-b",
    type=(_FACTOR, _FACTOR),
    default=(1e-2, 1e2),
    show_default=True,
    help="Range of b in the map, times the scenario's.",
)
@click.option(
    "--map-k",
    type=(_FACTOR, _FACTOR),
    default=(1e-4, 1e1),
    show_default=True,
    help="Range of k in the map, times the scenario's.",
)
@JSON
@click.option(
    "--validate",
    "validated",
    is_flag=True,
    help="Validate against simulation: find the onset of oscillation; takes minutes.",
)
@click.option(
    "--out",
    type=PATH,
    help="Folder of the onset study; cases that are in it are not run again.  "
    "[default: runs/NAME-onset]",
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes of the onset study.")
@click.option(
    "--draw",
    type=(click.IntRange(min=1), click.IntRange(min=0)),
    metavar="N SEED",
    help="Validate N cases drawn with a seed, in place of the grid of rays and angles.",
)
@SETTINGS
def stability(
    scenario: str,
    axis: Literal["x", "rotation", "coupled"],
    map_file: Path | None,
    map_b: tuple[float, float],
    map_k: tuple[float, float],
    as_json: bool,
    validated: bool,
    out: Path | None,
    workers: int | None,
    draw: tuple[int, int] | None,
    settings: tuple[str, ...],
) -> None:
    """Predict the stability of the compliance.

    Prints the margins along the path, without a run. With --validate, compares the prediction with
    simulations.
    """
    from dualbend.stability.prediction import predict

    loaded = load(scenario, settings)
    if validated:
        folder = out or Path("runs") / f"{loaded.name}-onset"
        _validate(loaded, axis, draw, folder, workers, as_json)
        return
    if out is not None or workers is not None or draw is not None:
        raise InputError("--out, --workers and --draw belong to --validate")
    prediction = predict(loaded, axis)
    if map_file is not None and prediction.rows:
        from dualbend.report.figures import plot_stability_map
        from dualbend.stability.map import stability_map

        panels = stability_map(loaded, prediction, map_b, map_k)
        plot_stability_map(panels, loaded.name, map_file)
    if as_json:
        print_json(prediction)
        return
    _show_prediction(prediction)


def _validate(
    loaded: Scenario,
    axis: Literal["x", "rotation", "coupled"],
    draw: tuple[int, int] | None,
    folder: Path,
    workers: int | None,
    as_json: bool,
) -> None:
    """Find the onsets, print each when it is found, and write numbers, table and picture."""
    from dualbend.study.onset.design import AXES, drawn, grid
    from dualbend.study.onset.figure import plot_onsets
    from dualbend.study.onset.report import describe_case, summary, write_report
    from dualbend.study.onset.results import Case
    from dualbend.study.onset.study import onset_study

    def tell(done: int, total: int, case: Case | None) -> None:
        if case is not None:
            click.echo(f"{done}/{total}  {describe_case(case)}", err=True)

    on = [each for each in AXES if getattr(loaded.compliance, each) is not None]
    axes = (on or AXES) if axis == "coupled" else (axis,)
    points = grid(axes) if draw is None else drawn(*draw, axes)
    found = onset_study(loaded, points, workers=workers, folder=folder, on_run=tell)
    write_report(found, folder)
    plot_onsets(loaded, found, folder / "onset.png")
    if as_json:
        print_json(found)
        return
    click.echo(summary(found))
    click.echo(f"results in {folder}")


def _show_prediction(prediction: Prediction) -> None:
    """Print a line for each bending angle, then the verdict."""
    if not prediction.rows:
        click.echo(f"{prediction.scenario}: {prediction.reason}")
        _show_not_covered(prediction)
        return
    click.echo(_table(prediction.rows))
    missed = [f"{row.alpha_rad:.2f}" for row in prediction.rows if not row.at_rest]
    if missed:
        click.echo(
            f"no equilibrium found, evaluated at the poses of the path: {', '.join(missed)} rad"
        )
    softened = max(row.softening_x for row in prediction.rows)
    click.echo(f"arms and grasps lower the stiffness along x by up to {100 * softened:.1f} %")
    for line in _imperfect(prediction.rows):
        click.echo(line)
    for low, high in prediction.unstable_rad:
        click.echo(f"predicted unstable from {low:.2f} to {high:.2f} rad")
    _show_not_covered(prediction)
    click.echo(f"{prediction.scenario}: {prediction.verdict} ({prediction.reason})")


def _show_not_covered(prediction: Prediction) -> None:
    if prediction.not_covered:
        click.echo(f"not in the prediction: {prediction.not_covered}")


def _imperfect(rows: Sequence[Row]) -> Iterator[str]:
    """Yield what late commands and wrong friction do to a stable loop."""
    stable = [row for row in rows if row.stable]
    if not stable:
        return
    late = min(row.jitter_cycles for row in stable)
    yield f"where stable it stays so with commands up to {late:.1f} cycles late, in any order"
    x, rotation = (
        1e3 * max(getattr(row, key) for row in stable) / 10.0
        for key in ("hunting_x_m", "hunting_rotation_rad")
    )
    parts = [f"{x:.2g} mm"] * (x > 0.0) + [f"{rotation:.2g} mrad"] * (rotation > 0.0)
    if parts:
        yield (
            "where a tenth of the dry friction is fed forward wrongly it hunts by up to "
            f"{' and '.join(parts)}"
        )


def _table(rows: Sequence[Row]) -> str:
    from dualbend.table import Columns, Table, quantity

    numbers = (
        *(("rad", ".2f"), ("N/mm", ".3f"), ("N m/rad", ".3f"), ("gain\nmargin\ndB", ".1f")),
        *(
            ("phase\nmargin\ndeg", ".0f"),
            ("delay\nmargin\nms", ".0f"),
            ("Hz", ".2f"),
            ("damping", ".2f"),
        ),
        ("growth\n1/s", ".2f"),
    )
    found = [quantity(name, spec=spec) for name, spec in numbers]
    columns: Columns = [*found[:3], "verdict", *found[3:], "(23)", "delayed"]
    lines = [
        (
            *(row.alpha_rad, row.stiffness_x_n_per_m / 1e3, row.stiffness_rotation_nm_per_rad),
            *(
                _word(row.stable),
                row.gain_margin_db,
                row.phase_margin_deg,
                1e3 * row.delay_margin_s,
            ),
            *(row.frequency_hz, row.damping_ratio, row.growth_per_s),
            *(_word(row.paper_stable), _word(row.delayed_stable)),
        )
        for row in rows
    ]
    return Table(columns, lines).text()


def _word(stable: bool | None) -> str:
    if stable is None:
        return "-"
    return "stable" if stable else "UNSTABLE"


@command("dualbend tune fig6 --out tuned.toml")
@SCENARIO
@click.option("--out", type=PATH, help="Scenario file to write.")
@click.option(
    "--gain-margin", type=Number(0.0, 100.0), default=6.0, help="Minimum gain margin [dB]."
)
@click.option(
    "--phase-margin", type=Number(0.0, 180.0), default=30.0, help="Minimum phase margin [deg]."
)
@click.option(
    "--seeds", type=click.IntRange(3, 20), default=5, help="Runs that compare the controllers."
)
@click.option(
    "--robust",
    type=click.Choice(["typical", "worst"]),
    help="Keep margins and moment in the worst case over these imperfections.",
)
@SETTINGS
def tune(
    scenario: str,
    out: Path | None,
    gain_margin: float,
    phase_margin: float,
    seeds: int,
    robust: PresetName | None,
    settings: tuple[str, ...],
) -> None:
    """Search for the gains with the smallest simulated moment.

    Starts from the scenario's own gains and keeps the required margins. The result is compared, by
    simulation, with no compliance and with the scenario's own. Takes about a minute.
    """
    from dualbend.study.tuning.search import Margin
    from dualbend.study.tuning.tuning import tune as search
    from dualbend.study.tuning.tuning import write_scenario

    if settings and out is not None:
        raise InputError("--out writes the differences from SCENARIO: put --set into a file")
    loaded = load(scenario, settings)
    required = Margin(gain_db=gain_margin, phase_deg=phase_margin)
    if robust is not None:
        _tune_robust(loaded, scenario, robust, required, seeds, out)
        return
    with progress_bar(100, f"tune {loaded.name}") as bar:
        found = search(
            loaded,
            required=required,
            seeds=seeds,
            on_progress=lambda share: bar.update(round(100 * share) - bar.pos),
        )
    _show_tuning(found, seeds)
    if out is not None:
        write_scenario(found, scenario, out)
        click.echo(f"{out}: run it with dualbend run {out}")
    if not found.chosen.margin.fulfils(required):
        click.echo("dualbend: the margins of the result are below the required ones", err=True)
        sys.exit(EXIT_FAILED_CHECK)


def _tune_robust(
    loaded: Scenario,
    base: str,
    preset: PresetName,
    required: Margin,
    seeds: int,
    out: Path | None,
) -> None:
    """Tune over the imperfections of a preset, print every case, and what limits the gains."""
    from dualbend.study.tuning.limits import said
    from dualbend.study.tuning.robust import tune_robust
    from dualbend.study.tuning.tuning import write_compliance
    from dualbend.table import Column, Table, quantity

    with progress_bar(100, f"tune {loaded.name}") as bar:
        found = tune_robust(
            loaded,
            preset,
            required=required,
            seeds=seeds,
            on_progress=lambda share: bar.update(round(100 * share) - bar.pos),
        )
    columns: list[Column | str] = ["rms with"]
    columns += [quantity(name, "mN m") for name in ("none", "own", "robust")]
    rows = [
        (case.name, 1e3 * case.none_nm, 1e3 * case.own_nm, 1e3 * case.found_nm, case.ratio)
        for case in found.cases
    ]
    click.echo(Table([*columns, quantity("ratio", "", ".2f")], rows).text())
    click.echo(
        f"worst: {found.worst.name}, {found.worst.ratio:.2f} of the moment without compliance; "
        f"margins in every loop at least {said(found.margin)}; {found.tried} gains tried, "
        f"searched with {', '.join(found.searched)}"
    )
    if found.left_out:
        left_out = ", ".join(found.left_out)
        click.echo(f"left out, since no run without compliance completes: {left_out}")
    for line in (*_gains(found.compliance), *found.limits):
        click.echo(line)
    if out is not None:
        write_compliance(found.compliance, base, f"{loaded.name}-robust", out)
        click.echo(f"{out}: run it with dualbend run {out}")
    if not found.worst.ratio < 1.0:
        click.echo("dualbend: in the worst case the moment is no less than without", err=True)
        sys.exit(EXIT_FAILED_CHECK)


def _show_tuning(found: Tuning, seeds: int) -> None:
    """Print how the controllers compare, which one is the result and what limits it."""
    from dualbend.study.tuning.tuning import SAID
    from dualbend.table import Table, quantity

    columns = [quantity("rms", "mN m"), quantity("peak", "mN m")]
    columns += [quantity("gain margin", "dB", ".1f"), quantity("phase margin", "deg", ".0f")]
    rows = [
        (
            *(SAID[each.name], 1e3 * each.rms_nm, 1e3 * each.peak_nm),
            *(each.margin.gain_db, each.margin.phase_deg),
        )
        for each in found.outcomes
    ]
    click.echo(Table(["moment while it bends", *columns], rows).text())
    first = found.scenario.seed
    click.echo(f"means of seeds {first} to {first + seeds - 1}; {found.tried} gains tried")
    for each in found.outcomes:
        if each.stops:
            click.echo(f"{SAID[each.name]}: {len(each.stops)} of {seeds} runs: {each.stops[0]}")
    click.echo(found.verdict)
    if found.chosen is not found.found:
        click.echo("the best gains found, which are not the result:")
    for line in (*_gains(found.found.compliance), *found.limits):
        click.echo(line)


def _gains(config: ComplianceConfig) -> Iterator[str]:
    """Yield the gains of a compliance, a line for each part."""
    from dualbend.control.compliance.mass_spring_damper import DIRECTIONS, MassSpringDamperConfig
    from dualbend.scenario.toml_text import toml
    from dualbend.stability.map import gain_units
    from dualbend.study.tuning.gains import OF_THE_MODEL

    for name, value in getattr(config, "options", {}).items():
        yield f"options.{name} = {toml(value)}"
    if isinstance(config, MassSpringDamperConfig):
        for direction in DIRECTIONS:
            if (part := getattr(config, direction)) is not None:
                yield f"{direction:<6} m = {part.m:g}, b = {part.b:g}, k = {part.k:g}, in SI"
        return
    axes: tuple[Literal["x", "rotation"], ...] = ("x", "rotation")
    for name in axes:
        axis: AxisConfig | None = getattr(config, name)
        if axis is not None:
            of_b, of_k = gain_units(config, name)
            yield f"{name:<9} b = {axis.b:g} {of_b}, k = {axis.k:g} {of_k}".removesuffix(" 1")
    for part, key in OF_THE_MODEL:
        value = getattr(getattr(config, part, None), key, None)
        if value is not None:
            yield f"{part}.{key} = {value:g}"
