"""The command line: parses, calls, prints, exits with a code.

0 completed, or ended as the scenario expects; 1 a validation row fails; 2 bad input; 3 a protective
stop or failed run that the scenario does not expect; 130 interrupted before there was a result.
Heavy imports happen inside the commands.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from dualbend.errors import DualbendError

if TYPE_CHECKING:
    from dualbend.analysis.stability import Prediction
    from dualbend.analysis.validation import Row
    from dualbend.run.runner import RunResult

EXIT_FAILED_CHECK, EXIT_BAD_INPUT, EXIT_UNEXPECTED, EXIT_INTERRUPTED = 1, 2, 3, 130

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
        except (KeyboardInterrupt, Exception) as error:
            if not _interrupted(error):
                raise
            click.echo("dualbend: interrupted before there was anything to keep", err=True)
            sys.exit(EXIT_INTERRUPTED)


def _interrupted(error: BaseException | None) -> bool:
    """Tell an interrupt, also one that a compiled library turned into an error of its own."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


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
    from dualbend.analysis.stability import predict
    from dualbend.run.make import make_run
    from dualbend.run.output import prepare_folder, uninterrupted
    from dualbend.run.scenario import load_scenario

    loaded = load_scenario(scenario, settings, seed)
    folder = out if out is not None else Path("runs") / loaded.name
    prepare_folder(folder)
    ready = make_run(loaded)
    prediction = predict(loaded)
    if prediction.rows:
        warning = "" if prediction.verdict == "stable" else "warning: "
        click.echo(
            f"{warning}{loaded.name}: compliance predicted {prediction.verdict} "
            f"({prediction.reason})",
            err=True,
        )
    with click.progressbar(
        length=ready.cycles,
        label=loaded.name,
        file=sys.stderr,
        hidden=not sys.stderr.isatty(),
    ) as bar:
        result = ready.run(on_cycle=lambda _: bar.update(1))
    with uninterrupted():
        failures = _write(result, folder, record)
    for failure in failures:
        click.echo(f"dualbend: {failure}", err=True)
    if failures:
        sys.exit(EXIT_BAD_INPUT)
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


def _write(result: RunResult, folder: Path, record: bool) -> list[str]:
    """Write everything that a run leaves and print what matters; return what could not be."""
    from dualbend.analysis.figures import plot_moment
    from dualbend.analysis.metrics import summary
    from dualbend.run import output

    numbers = summary(result)
    writers: dict[str, Callable[[Path], None]] = {
        "scenario.toml": partial(output.write_scenario, result),
        "trace.parquet": partial(output.write_trace, result),
        "summary.json": partial(output.write_summary, numbers),
        "moment.png": partial(plot_moment, result),
    }
    if record:
        from dualbend.run.recording import write_recording

        writers["run.rrd"] = partial(write_recording, result)
    failures = []
    for name, write in writers.items():
        try:
            write(folder / name)
        except OSError as error:
            failures.append(f"--out {folder}: {name}: {error.strerror or error}")
    ended = f" ({result.reason})" if result.reason else ""
    click.echo(f"{result.scenario.name}: {result.outcome}{ended}")
    for name, metric in numbers["metrics"].items():
        click.echo(f"  {name:<26}{_shown(metric['value']):>12}  {metric['unit']}")
    click.echo(f"results in {folder}")
    return failures


def _shown(value: float | list[float | None] | None) -> str:
    if isinstance(value, list):
        return " ".join(_shown(item) for item in value)
    return "-" if value is None else f"{value:.4g}"


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
    from dualbend.run.make import make_run
    from dualbend.run.scenario import load_scenario

    xml = make_run(load_scenario(scenario, settings)).scene_xml()
    try:
        out.write_text(xml, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from error
    click.echo(f"{out}: open it with python -m mujoco.viewer --mjcf={out}")


@main.command()
@click.argument("scenario")
@click.option("--out", type=click.Path(path_type=Path), required=True, help=".gif or .png file.")
@_SETTINGS
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the sensor noise.")
@click.option("--camera", help="Camera of the scene: front; bed, in an assembly.")
@click.option("--fps", type=float, default=10.0, show_default=True, help="Frames a second.")
@click.option("--speed", type=float, default=4.0, show_default=True, help="Times real time.")
@click.option("--width", type=int, default=480, show_default=True, help="Pixels; 16:9.")
@click.option("--at", "at_s", type=float, help="Time of a .png [s]; none: the end.")
@click.option("--inset/--no-inset", default=True, help="Close-up of a pin, in an assembly.")
def render(
    scenario: str,
    out: Path,
    settings: tuple[str, ...],
    seed: int | None,
    camera: str | None,
    fps: float,
    speed: float,
    width: int,
    at_s: float | None,
    inset: bool,
) -> None:
    """Run a scenario and draw it, without a screen.

    A video (.gif) or a picture (.png).

    Example: dualbend render pwb --out pwb.gif --speed 4
    """
    from dualbend.run import offscreen

    offscreen.prepare()  # before anything imports MuJoCo

    from dualbend.run.make import make_run
    from dualbend.run.render import Look, check_look, write_video
    from dualbend.run.scenario import load_scenario

    look = Look(camera=camera, fps=fps, speed=speed, width_px=width, at_s=at_s, inset=inset)
    ready = make_run(load_scenario(scenario, settings, seed))
    check_look(look, ready, out)
    result = ready.run()
    frames = write_video(result, out, look)
    ended = f" ({result.reason})" if result.reason else ""
    click.echo(f"{result.scenario.name}: {result.outcome}{ended}")
    click.echo(f"{out}: {frames} frame{'s' if frames > 1 else ''}")
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


@main.command()
@click.argument("scenario")
@_SETTINGS
def view(scenario: str, settings: tuple[str, ...]) -> None:
    """Run a scenario in MuJoCo's viewer.

    In real time, where there is a screen.
    """
    from dualbend.errors import InputError
    from dualbend.run.make import make_run
    from dualbend.run.scenario import load_scenario

    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError("view needs a screen; without one, dualbend run writes run.rrd instead")
    from dualbend.run.viewer import run_in_viewer

    result = run_in_viewer(make_run(load_scenario(scenario, settings)))
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


@main.command()
@click.argument("scenario")
@click.option(
    "--axis",
    type=click.Choice(["x", "rotation", "coupled"]),
    default="coupled",
    help="Axes that take part.",
)
@click.option(
    "--map", "map_file", type=click.Path(path_type=Path), help="PNG of the stable region in (b, k)."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@_SETTINGS
def stability(
    scenario: str,
    axis: Literal["x", "rotation", "coupled"],
    map_file: Path | None,
    as_json: bool,
    settings: tuple[str, ...],
) -> None:
    """Predict the stability of the compliance.

    Margins along the path, before any run.

    Example: dualbend stability fig9 --map fig9.png
    """
    from dualbend.analysis.stability import predict
    from dualbend.run.scenario import load_scenario

    loaded = load_scenario(scenario, settings)
    prediction = predict(loaded, axis)
    if map_file is not None and prediction.rows:
        from dualbend.analysis.figures import plot_stability_map
        from dualbend.analysis.stability_map import stability_map

        plot_stability_map(stability_map(loaded, prediction), loaded.name, map_file)
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(prediction), indent=2).decode())
        return
    _show_prediction(prediction)


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
        click.echo(f"no state of rest found, judged at the path's poses: {', '.join(missed)} rad")
    softened = max(row.softening_x for row in prediction.rows)
    click.echo(f"arms and grasps lower the stiffness along x by up to {100 * softened:.1f} %")
    for low, high in prediction.unstable_rad:
        click.echo(f"predicted unstable from {low:.2f} to {high:.2f} rad")
    click.echo(f"{prediction.scenario}: {prediction.verdict} ({prediction.reason})")


def _word(stable: bool) -> str:
    return "stable" if stable else "UNSTABLE"
