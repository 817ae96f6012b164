"""The command line: parses, calls, prints, exits with a code.

0 completed, or ended as the scenario expects; 1 a validation row fails; 2 bad input; 3 a protective
stop or failed run that the scenario does not expect; 130 interrupted before there was a result.
Heavy imports happen inside the commands.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from dualbend.errors import DualbendError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from dualbend.analysis.stability import Prediction
    from dualbend.analysis.validation import Row
    from dualbend.run.runner import RunResult
    from dualbend.run.scenario import Scenario

_EXAMPLES_HEADING = "\b\nExample:"
"""The control character keeps click from filling the lines below it into a paragraph."""

EXIT_FAILED_CHECK, EXIT_BAD_INPUT, EXIT_UNEXPECTED, EXIT_INTERRUPTED = 1, 2, 3, 130

_SETTINGS = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH.TO.KEY=VALUE",
    help="Change one key of the scenario; may be given more than once.",
)


def _examples(*lines: str) -> str:
    """Return an epilog that shows each line as it is typed."""
    return "\n".join((_EXAMPLES_HEADING, *(f"  {line}" for line in lines)))


def _scenarios(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from dualbend.run.completion import complete_scenario

    return complete_scenario(incomplete)


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


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=_examples("dualbend run fig8 --out runs/fig8", "dualbend run --help"),
)
@click.version_option(package_name="dualbend")
def main() -> None:
    """Two position-controlled arms bend a flexible sheet."""


@main.command(
    epilog=_examples(
        "dualbend run fig8 --out runs/fig8 --set alter.delay_cycles=3",
        "dualbend run mine.toml --seed 2 --no-record",
    )
)
@click.argument("scenario", required=False, shell_complete=_scenarios)
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the results.")
@_SETTINGS
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the sensor noise.")
@click.option("--record/--no-record", default=True, help="Write run.rrd for the rerun viewer.")
def run(
    scenario: str | None,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    record: bool,
) -> None:
    """Run a scenario and leave its results in a folder.

    SCENARIO is a name from dualbend list or a .toml file; without it, the shipped ones are listed.
    """
    if scenario is None:
        _which_scenario(asked=not _any_given())
        return
    from dualbend.analysis.stability import predict
    from dualbend.run.make import make_run
    from dualbend.run.output import prepare_folder, trace_kept, uninterrupted
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
    with (
        click.progressbar(
            length=ready.cycles,
            label=loaded.name,
            file=sys.stderr,
            hidden=not sys.stderr.isatty(),
        ) as bar,
        trace_kept(ready, folder) as keep,
    ):

        def step(_: int) -> None:
            bar.update(1)
            keep()

        result = ready.run(on_cycle=step)
        with uninterrupted():
            failures = _write(result, folder, record)
    for failure in failures:
        click.echo(f"dualbend: {failure}", err=True)
    if failures:
        sys.exit(EXIT_BAD_INPUT)
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


def _any_given() -> bool:
    """Tell whether the command line has any option or argument of the present command."""
    context = click.get_current_context()
    default = click.core.ParameterSource.DEFAULT
    return any(context.get_parameter_source(name) is not default for name in context.params)


def _which_scenario(*, asked: bool) -> None:
    """Show the scenarios: to who asks they are the answer, options without one are an error."""
    from dualbend.errors import InputError
    from dualbend.run import shipped

    if not asked:
        raise InputError(f"run needs a SCENARIO: {', '.join(shipped.descriptions())}, or a file")
    click.echo(shipped.table())
    click.echo("\nRun one, for example: dualbend run fig8 --out runs/fig8")


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


@main.command(
    epilog=_examples(
        "dualbend beam --length 0.6 --width 0.1 --thickness 0.001 --young 69e9 --alpha 0.2"
    )
)
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
    """Force, moment and shape of a sheet between two grips."""
    from dualbend.beam.calculator import bent_sheet

    state = bent_sheet(length, width, thickness, young, alpha, half_distance, weight)
    if as_json:
        import json

        click.echo(json.dumps(state))
        return
    for key, value in state.items():
        click.echo(f"{key:<22}{value:>14.6g}")


@main.command(epilog=_examples("dualbend validate --json"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def validate(as_json: bool) -> None:
    """Measure how far simulation is from theory.

    Takes a minute or two; exit code 1 where a row fails.
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


@main.command(epilog=_examples("dualbend audit --out docs/audit.md"))
@click.option("--scan", is_flag=True, help="Make the table of readings anew first; ten minutes.")
@click.option("--out", type=click.Path(path_type=Path), help="Markdown file to write.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def audit(scan: bool, out: Path | None, as_json: bool) -> None:
    """Check the paper's equations and numbers.

    Prints the page, or writes it.
    """
    from dualbend.analysis.audit import audit as check
    from dualbend.analysis.audit import page, run_scan
    from dualbend.analysis.audit_reading import readings
    from dualbend.errors import InputError

    if scan:
        with click.progressbar(
            length=sum(1 for _ in readings()),
            label="readings",
            file=sys.stderr,
            hidden=not sys.stderr.isatty(),
        ) as bar:
            run_scan(on_row=lambda _: bar.update(1))
    found = check()
    if out is not None:
        try:
            out.write_text(page(found), encoding="utf-8")
        except OSError as error:
            raise InputError(f"--out {out}: cannot be written: {error.strerror}") from error
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(found), indent=2).decode())
    elif out is None:
        click.echo(page(found), nl=False)
    else:
        click.echo(f"{len(found.findings())} statements in {out}")


@main.command("list", epilog=_examples("dualbend list"))
def list_command() -> None:
    """List the shipped scenarios."""
    from dualbend.run import shipped

    click.echo(shipped.table())


@main.command(
    epilog=_examples("dualbend new mine", "dualbend new mine --from fig8", "dualbend run mine.toml")
)
@click.argument("name")
@click.option(
    "--from",
    "base",
    default="fig6",
    show_default=True,
    metavar="SCENARIO",
    shell_complete=_scenarios,
    help="Whose values it has.",
)
def new(name: str, base: str) -> None:
    """Write NAME.toml, a scenario with every key explained.

    Keys at their default are comments. An existing file is left as it is.
    """
    from dualbend.run.new import write_scenario

    path = write_scenario(name, base)
    click.echo(f"{path}: edit it, then dualbend run {path}")


@main.command(epilog=_examples("dualbend schema --out scenario.schema.json"))
@click.option("--out", type=click.Path(path_type=Path), help="File to write; none: print.")
def schema(out: Path | None) -> None:
    """Give the JSON schema of a scenario file, for editors."""
    from dualbend.run.schema import schema_text

    _deliver(schema_text(), out)


@main.command(epilog=_examples("dualbend reference --out docs/reference.md"))
@click.option("--out", type=click.Path(path_type=Path), help="File to write; none: print.")
def reference(out: Path | None) -> None:
    """Give every section and key of a scenario as Markdown."""
    from dualbend.run.reference import reference_markdown

    _deliver(reference_markdown(), out)


def _deliver(text: str, out: Path | None) -> None:
    """Print a text, or write it where it is wanted."""
    from dualbend.errors import InputError

    if out is None:
        click.echo(text, nl=False)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from error
    click.echo(f"{out} written")


@main.command(epilog=_examples("dualbend scene fig8 --out fig8.xml"))
@click.argument("scenario", shell_complete=_scenarios)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="MJCF file to write.")
@_SETTINGS
def scene(scenario: str, out: Path, settings: tuple[str, ...]) -> None:
    """Write the composed MJCF of a scenario.

    Its start is the key frame "start".
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


@main.command(epilog=_examples("dualbend render pwb --out pwb.gif --speed 4"))
@click.argument("scenario", shell_complete=_scenarios)
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


@main.command(epilog=_examples("dualbend view fig8 --set motion.speed_rad_per_s=0.2"))
@click.argument("scenario", shell_complete=_scenarios)
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


@main.command(epilog=_examples("dualbend plan pwb --set assembly.layout.holes.clearance_m=1e-4"))
@click.argument("scenario", shell_complete=_scenarios)
@_SETTINGS
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def plan(scenario: str, settings: tuple[str, ...], as_json: bool) -> None:
    """Plan an assembly: the bending angles at which it fits.

    Where the middle holes go over their pins and the outer ones clear theirs.

    Without a run. A layout that has no such angle is refused with what is missing.
    """
    import json

    from dualbend.run.assembly_run import assembly_plan
    from dualbend.run.scenario import load_scenario
    from dualbend.task.assembly_plan import plan_summary

    loaded = load_scenario(scenario, settings)
    found = plan_summary(assembly_plan(loaded), loaded.path.end_rad)
    if as_json:
        click.echo(json.dumps({name: value for name, (value, _) in found.items()}, indent=2))
        return
    for name, (value, unit) in found.items():
        click.echo(f"{name:<30}{_shown(value):>12}  {unit}")


@main.command(epilog=_examples("dualbend benchmark fig8 --repeat 3"))
@click.argument("scenario", default="fig8", shell_complete=_scenarios)
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


@main.command(epilog=_examples("dualbend robustness pwb --runs 40 --workers 2"))
@click.argument("scenario", shell_complete=_scenarios)
@click.option("--runs", type=click.IntRange(min=1), required=True, help="Number of draws.")
@click.option(
    "--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Seed of the draws."
)
@click.option(
    "--workers", type=click.IntRange(1, 256), help="Parallel processes; else one for each core."
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the study.")
@_SETTINGS
def robustness(
    scenario: str,
    runs: int,
    seed: int,
    workers: int | None,
    out: Path | None,
    settings: tuple[str, ...],
) -> None:
    """Assemble many sheets that differ, with compliance and without.

    The errors are drawn with the standard deviations of assembly.spread. The same command goes on
    with a study that was interrupted.
    """
    from dualbend.analysis.figures_robustness import plot_success
    from dualbend.analysis.robustness_study import run_study
    from dualbend.analysis.robustness_summary import summarise, table
    from dualbend.errors import InputError
    from dualbend.run.output import uninterrupted, write_summary
    from dualbend.run.scenario import load_scenario

    loaded = load_scenario(scenario, settings)
    folder = out if out is not None else Path("runs") / f"{loaded.name}-robustness"
    processes = workers if workers is not None else os.cpu_count() or 1
    done, interrupted = 0, False
    with click.progressbar(
        length=0, label=loaded.name, file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:

        def show(count: int, total: int) -> None:
            nonlocal done
            bar.length = total
            bar.update(count - done)
            done = count

        try:
            trials = run_study(
                loaded, folder, runs=runs, seed=seed, workers=processes, on_trial=show
            )
        except KeyboardInterrupt:
            interrupted = True
    if interrupted:
        click.echo(
            f"dualbend: interrupted after {done} of {bar.length} runs, kept in {folder}; "
            "the same command goes on",
            err=True,
        )
        sys.exit(EXIT_INTERRUPTED)
    numbers = summarise(loaded, seed, trials, folder)
    with uninterrupted():
        try:
            write_summary(numbers, folder / "summary.json")
        except OSError as error:
            raise InputError(f"--out {folder}: {error.strerror or error}") from error
        plot_success(trials, loaded, folder / "success.png")
    click.echo("\n".join(table(numbers)))
    click.echo(f"results in {folder}")


@main.command(epilog=_examples("dualbend stability fig9 --map fig9.png"))
@click.argument("scenario", shell_complete=_scenarios)
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
@_SETTINGS
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
    from dualbend.analysis.stability import predict
    from dualbend.errors import InputError
    from dualbend.run.scenario import load_scenario

    loaded = load_scenario(scenario, settings)
    if confronted:
        _confront(loaded, axis, out or Path("runs") / f"{loaded.name}-confront", workers, as_json)
        return
    if out is not None or workers is not None:
        raise InputError("--out and --workers belong to --confront")
    prediction = predict(loaded, axis)
    if map_file is not None and prediction.rows:
        from dualbend.analysis.figures import plot_stability_map
        from dualbend.analysis.stability_map import stability_map

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
    from dualbend.analysis.confront import AXES, confront
    from dualbend.analysis.confront_report import describe_case, summary, write_report
    from dualbend.analysis.figures_confront import plot_confrontation

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
        click.echo(f"no state of rest found, judged at the path's poses: {', '.join(missed)} rad")
    softened = max(row.softening_x for row in prediction.rows)
    click.echo(f"arms and grasps lower the stiffness along x by up to {100 * softened:.1f} %")
    for low, high in prediction.unstable_rad:
        click.echo(f"predicted unstable from {low:.2f} to {high:.2f} rad")
    click.echo(f"{prediction.scenario}: {prediction.verdict} ({prediction.reason})")


def _word(stable: bool) -> str:
    return "stable" if stable else "UNSTABLE"


@main.command(epilog=_examples("dualbend tune fig6 --out tuned.toml"))
@click.argument("scenario", shell_complete=_scenarios)
@click.option("--out", type=click.Path(path_type=Path), help="Scenario file to write.")
@click.option("--gain-margin", type=float, default=6.0, help="Least gain margin [dB].")
@click.option("--phase-margin", type=float, default=30.0, help="Least phase margin [deg].")
@click.option("--seeds", type=click.IntRange(1, 20), default=3, help="Noise streams, 1 to n.")
@_SETTINGS
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
    from dualbend.analysis.tuning import Margin, write_scenario
    from dualbend.analysis.tuning import tune as search
    from dualbend.errors import InputError
    from dualbend.run.scenario import load_scenario

    if settings and out is not None:
        raise InputError("--out writes what differs from SCENARIO itself: put --set into a file")
    least = Margin(gain_db=gain_margin, phase_deg=phase_margin)
    found = search(load_scenario(scenario, settings), least=least, seeds=range(1, seeds + 1))
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
    if not found.verified.fulfils(least):
        click.echo("dualbend: the margins of the result are below those asked for", err=True)
        sys.exit(EXIT_FAILED_CHECK)
