"""The command line: parses, calls, prints, exits with a code.

0 completed, or ended as the scenario expects; 1 a validation row fails; 2 bad input; 3 a protective
stop or failed run that the scenario does not expect. Heavy imports happen inside the commands.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.errors import DualbendError

if TYPE_CHECKING:
    from dualbend.analysis.validation import Row
    from dualbend.run.runner import RunResult

EXIT_FAILED_CHECK, EXIT_BAD_INPUT, EXIT_UNEXPECTED = 1, 2, 3

_SETTINGS = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH.TO.KEY=VALUE",
    help="Change one key of the scenario; may be given more than once.",
)


class _Commands(click.Group):
    """Turns what a user gave wrongly into one message and exit code 2."""

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except DualbendError as error:
            click.echo(f"dualbend: {error}", err=True)
            sys.exit(EXIT_BAD_INPUT)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="dualbend")
def main() -> None:
    """Two position-controlled arms bend a flexible sheet."""


@main.command()
@click.argument("scenario")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the results.")
@_SETTINGS
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the sensor noise.")
@click.option("--record/--no-record", default=True, help="Write run.rrd for the rerun viewer.")
def run(
    scenario: str, out: Path | None, settings: tuple[str, ...], seed: int | None, record: bool
) -> None:
    """Run a scenario and leave its results in a folder.

    SCENARIO is a name from dualbend list or a .toml file.

    Example: dualbend run fig8 --out runs/fig8 --set alter.delay_cycles=3
    """
    from dualbend.run.output import prepare_folder
    from dualbend.run.runner import BendingRun
    from dualbend.run.scenario import load_scenario

    loaded = load_scenario(scenario, settings, seed)
    folder = out if out is not None else Path("runs") / loaded.name
    prepare_folder(folder)
    ready = BendingRun(loaded)
    with click.progressbar(
        length=ready.motion.cycles,
        label=loaded.name,
        file=sys.stderr,
        hidden=not sys.stderr.isatty(),
    ) as bar:
        result = ready.run(on_cycle=lambda _: bar.update(1))
    _write(result, folder, record)
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


def _write(result: RunResult, folder: Path, record: bool) -> None:
    """Write everything that a run leaves, the irreplaceable first, and print what matters."""
    from dualbend.analysis.figures import plot_moment
    from dualbend.analysis.metrics import summary
    from dualbend.run import output

    output.write_scenario(result, folder)
    output.write_trace(result, folder)
    numbers = summary(result)
    output.write_summary(numbers, folder)
    plot_moment(result, folder / "moment.png")
    if record:
        from dualbend.run.recording import write_recording

        write_recording(result, folder / "run.rrd")
    click.echo(
        f"{result.scenario.name}: {result.outcome}" + f" ({result.reason})" * bool(result.reason)
    )
    for name, metric in numbers["metrics"].items():
        click.echo(f"  {name:<26}{_shown(metric['value']):>12}  {metric['unit']}")
    click.echo(f"results in {folder}")


def _shown(value: float | list[float] | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return " ".join(f"{item:.4g}" for item in value)
    return f"{value:.4g}"


@main.command()
@click.option("--length", type=float, required=True, help="Free length L [m].")
@click.option("--width", type=float, required=True, help="Width w [m].")
@click.option("--thickness", type=float, required=True, help="Thickness t [m].")
@click.option("--young", type=float, required=True, help="Young's modulus E [Pa].")
@click.option("--alpha", type=float, required=True, help="End slope α [rad].")
@click.option(
    "--half-distance", type=float, help="Half distance of the grips [m]; none: no end moment."
)
@click.option("--weight", type=float, default=0.0, help="Weight per length q [N/m].")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def beam(
    length: float,
    width: float,
    thickness: float,
    young: float,
    alpha: float,
    half_distance: float | None,
    weight: float,
    as_json: bool,
) -> None:
    """Force, moment and shape of a sheet between two grips.

    Example: dualbend beam --length 0.6 --width 0.1 --thickness 0.001 --young 69e9 --alpha 0.2
    """
    from dualbend.beam.calculator import bent_sheet

    state = bent_sheet(length, width, thickness, young, alpha, half_distance, weight)
    if as_json:
        click.echo(json.dumps(state))
        return
    for key, value in state.items():
        click.echo(f"{key:<22}{value:>14.6g}")


@main.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def validate(as_json: bool) -> None:
    """Measure how far simulation is from theory.

    Takes 20 s; exit code 1 where a row fails.
    """
    from dualbend.analysis.validation import run_validation

    rows = run_validation(None if as_json else _show_row)
    if as_json:
        import msgspec

        # A number that could not be measured is null: NaN is no JSON.
        click.echo(msgspec.json.format(msgspec.json.encode(rows), indent=2).decode())
    failed = [row for row in rows if not row.passed]
    if not as_json:
        click.echo(f"{len(rows) - len(failed)} of {len(rows)} rows pass")
    if failed:
        sys.exit(EXIT_FAILED_CHECK)


def _show_row(row: Row) -> None:
    verdict = "pass" if row.passed else "FAIL"
    allowed = f"error {row.error:.2g} of {row.tolerance:.2g}" if row.tolerance else ""
    click.echo(
        f"{verdict}  {row.name:<70}{row.measured:>12.5g}{row.reference:>12.5g} "
        f"{row.unit:<8} {allowed}".rstrip()
    )


@main.command("list")
def list_command() -> None:
    """List the shipped scenarios."""
    from dualbend.run.scenario import list_scenarios, load_scenario

    for name in list_scenarios():
        click.echo(f"{name:<12}{load_scenario(name).description}")


@main.command()
@click.argument("scenario")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="MJCF file to write.")
@_SETTINGS
def scene(scenario: str, out: Path, settings: tuple[str, ...]) -> None:
    """Write the composed MJCF of a scenario.

    Its start is the key frame "start".

    Example: dualbend scene fig8 --out fig8.xml
    """
    from dualbend.errors import InputError
    from dualbend.run.runner import BendingRun
    from dualbend.run.scenario import load_scenario

    xml = BendingRun(load_scenario(scenario, settings)).scene_xml()
    try:
        out.write_text(xml, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from error
    click.echo(f"{out}: open it with python -m mujoco.viewer --mjcf={out}")


@main.command()
@click.argument("scenario")
@_SETTINGS
def view(scenario: str, settings: tuple[str, ...]) -> None:
    """Run a scenario in MuJoCo's viewer.

    In real time, where there is a screen.
    """
    from dualbend.errors import InputError
    from dualbend.run.runner import BendingRun
    from dualbend.run.scenario import load_scenario

    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError("view needs a screen; without one, dualbend run writes run.rrd instead")
    from dualbend.run.viewer import run_in_viewer

    result = run_in_viewer(BendingRun(load_scenario(scenario, settings)))
    click.echo(f"{result.outcome} {result.reason}".rstrip())
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


@main.command()
@click.argument("scenario", default="fig8")
@_SETTINGS
@click.option("--repeat", type=click.IntRange(min=1), default=5, help="Repetitions.")
def benchmark(scenario: str, settings: tuple[str, ...], repeat: int) -> None:
    """Time the loop against bare mj_step calls.

    The same model, in one process, in turn.
    """
    import msgspec

    from dualbend.analysis.benchmark import benchmark as measure
    from dualbend.run.scenario import load_scenario

    for name, value in msgspec.to_builtins(
        measure(load_scenario(scenario, settings), repeat)
    ).items():
        click.echo(
            f"{name:<24}{value:>10.4g}" if isinstance(value, float) else f"{name:<24}{value:>10}"
        )
