"""Commands that predict the stability of the admittance loop, and tune it: stability, tune."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from dualbend.cli.common import EXIT_FAILED_CHECK, SETTINGS, complete_scenarios, examples

if TYPE_CHECKING:
    from dualbend.scenario.scenario import Scenario
    from dualbend.stability.prediction import Prediction


@click.command(epilog=examples("dualbend stability fig9 --map fig9.png"))
@click.argument("scenario", shell_complete=complete_scenarios)
@click.option(
    "--axis",
    type=click.Choice(["x", "rotation", "coupled"]),
    default="coupled",
    help="Axes that take part.",
)
@click.option(
    "--map", "map_file", type=click.Path(path_type=Path), help="PNG of the stable region in (b, k)."
)
@click.option(
    "--map-b",
    type=(float, float),
    default=(1e-2, 1e2),
    show_default=True,
    help="Range of b in the map, times the scenario's.",
)
@click.option(
    "--map-k",
    type=(float, float),
    default=(1e-4, 1e1),
    show_default=True,
    help="Range of k in the map, times the scenario's.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option(
    "--confront",
    "confronted",
    is_flag=True,
    help="Bisect the onset in the full simulation, held at some angles; takes minutes.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of a confrontation; what is there already is not done again.",
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes of a confrontation.")
@SETTINGS
def stability(
    scenario: str,
    axis: Literal["x", "rotation", "coupled"],
    map_file: Path | None,
    map_b: tuple[float, float],
    map_k: tuple[float, float],
    as_json: bool,
    confronted: bool,
    out: Path | None,
    workers: int | None,
    settings: tuple[str, ...],
) -> None:
    """Predict the stability of the compliance.

    Margins along the path, before any run; or, with --confront, prediction against simulation.
    """
    from dualbend.errors import InputError
    from dualbend.scenario.load import load_scenario
    from dualbend.stability.prediction import predict

    loaded = load_scenario(scenario, settings)
    if confronted:
        _confront(loaded, axis, out or Path("runs") / f"{loaded.name}-confront", workers, as_json)
        return
    if out is not None or workers is not None:
        raise InputError("--out and --workers belong to --confront")
    prediction = predict(loaded, axis)
    if map_file is not None and prediction.rows:
        from dualbend.report.figures import plot_stability_map
        from dualbend.stability.map import stability_map

        panels = stability_map(loaded, prediction, map_b, map_k)
        plot_stability_map(panels, loaded.name, map_file)
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(prediction), indent=2).decode())
        return
    _show_prediction(prediction)


def _confront(
    loaded: Scenario,
    axis: Literal["x", "rotation", "coupled"],
    folder: Path,
    workers: int | None,
    as_json: bool,
) -> None:
    """Bisect, tell each case as it is found, and leave table and picture beside the numbers."""
    from dualbend.study.onset.bisection import AXES, confront
    from dualbend.study.onset.figure import plot_confrontation
    from dualbend.study.onset.report import describe_case, summary, write_report

    found = confront(
        loaded,
        axes=AXES if axis == "coupled" else (axis,),
        workers=workers,
        folder=folder,
        progress=lambda done, of, case: click.echo(f"{done}/{of}  {describe_case(case)}", err=True),
    )
    write_report(found, folder)
    plot_confrontation(loaded, found, folder / "confrontation.png")
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(found), indent=2).decode())
        return
    click.echo(summary(found))
    click.echo(f"results in {folder}")


def _show_prediction(prediction: Prediction) -> None:
    """Print a line for each bending angle, then the verdict."""
    if not prediction.rows:
        click.echo(f"{prediction.scenario}: {prediction.reason}")
        return
    click.echo(
        " rad   N/mm  N m/rad  verdict    gain  phase   delay     Hz  damping  growth  "
        "(23)  delayed\n"
        "                              margin    deg      ms                     1/s"
    )
    for row in prediction.rows:
        click.echo(
            f"{row.alpha_rad:4.2f}{row.stiffness_x_n_per_m / 1e3:7.3f}"
            f"{row.stiffness_rotation_nm_per_rad:9.3f}  {_word(row.stable):<8}"
            f"{row.gain_margin:7.2f}{row.phase_margin_deg:7.0f}{1e3 * row.delay_margin_s:8.0f}"
            f"{row.frequency_hz:7.2f}{row.damping_ratio:9.2f}{row.growth_per_s:8.2f}  "
            f"{_word(row.paper_stable):<8}  {_word(row.delayed_stable)}"
        )
    missed = [f"{row.alpha_rad:.2f}" for row in prediction.rows if not row.at_rest]
    if missed:
        click.echo(f"no equilibrium found, evaluated at the path's poses: {', '.join(missed)} rad")
    softened = max(row.softening_x for row in prediction.rows)
    click.echo(f"arms and grasps lower the stiffness along x by up to {100 * softened:.1f} %")
    for low, high in prediction.unstable_rad:
        click.echo(f"predicted unstable from {low:.2f} to {high:.2f} rad")
    click.echo(f"{prediction.scenario}: {prediction.verdict} ({prediction.reason})")


def _word(stable: bool) -> str:
    return "stable" if stable else "UNSTABLE"


@click.command(epilog=examples("dualbend tune fig6 --out tuned.toml"))
@click.argument("scenario", shell_complete=complete_scenarios)
@click.option("--out", type=click.Path(path_type=Path), help="Scenario file to write.")
@click.option("--gain-margin", type=float, default=6.0, help="Least gain margin [dB].")
@click.option("--phase-margin", type=float, default=30.0, help="Least phase margin [deg].")
@click.option("--seeds", type=click.IntRange(1, 20), default=3, help="Noise streams, 1 to n.")
@SETTINGS
def tune(
    scenario: str,
    out: Path | None,
    gain_margin: float,
    phase_margin: float,
    seeds: int,
    settings: tuple[str, ...],
) -> None:
    """Find the gains with the lowest predicted moment.

    At required margins, verified by simulation. Takes a minute or two.
    """
    from dualbend.errors import InputError
    from dualbend.scenario.load import load_scenario
    from dualbend.stability.tuning import Margin, write_scenario
    from dualbend.stability.tuning import tune as search

    if settings and out is not None:
        raise InputError("--out writes what differs from SCENARIO itself: put --set into a file")
    required = Margin(gain_db=gain_margin, phase_deg=phase_margin)
    found = search(load_scenario(scenario, settings), required=required, seeds=range(1, seeds + 1))
    config = found.found.compliance
    for name, axis in (("x", config.x), ("rotation", config.rotation)):
        if axis is not None:
            click.echo(f"{name:<9} b = {axis.b:g} s, k = {axis.k:g}")
    if config.predictor is not None and config.predictor.lead_x_s is not None:
        click.echo(f"lead      {config.predictor.lead_x_s:g} s")
    click.echo(
        f"margins   {found.verified.gain_db:.1f} dB, {found.verified.phase_deg:.0f} deg "
        f"({found.tried} gains tried)"
    )
    for label, peaks in (("no compliance", found.without), ("predicted", found.found.peaks)):
        click.echo(f"{label:<14}{' '.join(f'{1e3 * p:6.2f}' for p in peaks)} mN m by piece")
    for seed, peaks in enumerate(found.simulated, 1):
        click.echo(f"seed {seed:<9}{' '.join(f'{1e3 * p:6.2f}' for p in peaks)} mN m by piece")
    if out is not None:
        write_scenario(found, scenario, out)
        click.echo(f"{out}: run it with dualbend run {out}")
    if not found.verified.fulfils(required):
        click.echo("dualbend: the margins of the result are below those asked for", err=True)
        sys.exit(EXIT_FAILED_CHECK)
