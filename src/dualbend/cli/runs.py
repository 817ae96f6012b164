"""Commands that run one scenario or show its scene."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from dualbend.cli.common import (
    EXIT_BAD_INPUT,
    NUMBER,
    PATH,
    SCENARIO,
    SEED,
    SETTINGS,
    Number,
    command,
    exit_by,
    load,
    progress_bar,
    show_end,
    show_warnings,
    shown,
)
from dualbend.cli.completion import complete_scenarios
from dualbend.errors import InputError, writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from dualbend.recording.live import LiveRecording
    from dualbend.run.disk.folder import RunFolder
    from dualbend.run.loop import Run
    from dualbend.run.record import RunRecord
    from dualbend.scenario.scenario import Scenario


@command(
    "dualbend run fig8 --out runs/fig8 --set robot.alter.delay_cycles=3",
    "dualbend run mine.toml --seed 2 --no-record",
    "dualbend run pwb --view",
)
@click.argument("scenario", required=False, shell_complete=complete_scenarios)
@click.option("--out", type=PATH, help="Folder for the results.")
@SETTINGS
@SEED
@click.option("--record/--no-record", default=True, help="Write run.rrd for the rerun viewer.")
@click.option(
    "--view",
    "address",
    is_flag=False,
    flag_value="spawn",
    metavar="[ADDRESS]",
    help="Show the run live in rerun's viewer; an ADDRESS is rerun+http://HOST:PORT/proxy.",
)
def run(
    scenario: str | None,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    record: bool,
    address: str | None,
) -> None:
    """Run a scenario and write its results into a folder.

    SCENARIO is a name from dualbend list or a .toml file. Without it, the shipped scenarios are
    listed.
    """
    if scenario is None:
        _which_scenario(asked=not _any_given())
        return
    carry_out(load(scenario, settings, seed), out, record=record, address=address)


def carry_out(
    scenario: Scenario,
    out: Path | None,
    *,
    record: bool,
    address: str | None = None,
    drive: Callable[[Run, Path, Callable[[int], None]], RunRecord] | None = None,
) -> None:
    """Run a scenario and write its results, as ``dualbend run`` does.

    ``drive`` goes from the ready run, whose folder it gets, to its end in the place of the
    scenario's own controller, of which nothing is predicted then.
    """
    from dualbend.evaluation.warnings import scenario_warnings
    from dualbend.interrupts import uninterrupted
    from dualbend.run.disk.folder import run_folder
    from dualbend.run.make import make_run

    with run_folder(out if out is not None else Path("runs") / scenario.name) as kept:
        ready = make_run(scenario)
        live = nullcontext() if address is None else _live(ready, address, kept, record=record)
        show_warnings(scenario.name, scenario_warnings(scenario))
        if drive is None:
            _tell_stability(ready.scenario)
            if scenario.serve is not None and scenario.serve.client is not None:
                click.echo(
                    f"{scenario.name}: by compliance.kind; serve.client is started by dualbend "
                    "serve and dualbend check",
                    err=True,
                )
        with (
            progress_bar(ready.cycles, scenario.name) as bar,
            kept.log(ready) as keep,
            live as picture,
        ):

            def step(cycles: int) -> None:
                bar.update(1)
                keep()
                if picture is not None:
                    picture.note(cycles)

            # A garbage collection in the loop has nothing to find in what was there before.
            gc.freeze()
            result = ready.run(on_cycle=step) if drive is None else drive(ready, kept.folder, step)
            gc.unfreeze()
        if result.signal and (kept.whole or not result.trace.rows):
            _leave_the_log(result, kept)
        with uninterrupted():
            failures = _write(result, kept, record, picture)
    for failure in failures:
        click.echo(f"dualbend: {failure}", err=True)
    if failures:
        sys.exit(EXIT_BAD_INPUT)
    exit_by(result)


def _leave_the_log(result: RunRecord, kept: RunFolder) -> NoReturn:
    """End after a signal, without a result that would take the place of an earlier, whole one."""
    click.echo(f"dualbend: {result.reason}; {kept.said_of_log()}", err=True)
    sys.exit(128 + result.signal)


def _tell_stability(scenario: Scenario) -> None:
    """Print the predicted stability; a run without a possible prediction is not refused."""
    from dualbend.stability.prediction import predict

    try:
        prediction = predict(scenario)
    except InputError as error:
        click.echo(f"{scenario.name}: stability not predicted: {error}", err=True)
        return
    if prediction.rows:
        warning = "" if prediction.verdict == "stable" else "warning: "
        elastic = ", for the sheet before it yields" if scenario.sheet.plastic else ""
        click.echo(
            f"{warning}{scenario.name}: compliance predicted {prediction.verdict}{elastic} "
            f"({prediction.reason})",
            err=True,
        )


def _live(
    ready: Run, address: str, kept: RunFolder, *, record: bool
) -> AbstractContextManager[LiveRecording]:
    """Return the live recording of a run in a viewer that answers."""
    from dualbend.recording.live import LiveRecording, check_viewer

    viewer = check_viewer(address, screen=_has_screen())
    with writing(kept.folder, "--out"):
        path = kept.unfinished / "run.rrd" if record else None
        return LiveRecording(ready, viewer, path)


def _has_screen() -> bool:
    return sys.platform != "linux" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def _any_given() -> bool:
    """Return whether the command line has any option or argument of the present command."""
    context = click.get_current_context()
    default = click.core.ParameterSource.DEFAULT
    return any(context.get_parameter_source(name) is not default for name in context.params)


def _which_scenario(*, asked: bool) -> None:
    """Print the scenarios if nothing was given; options without a scenario are an error."""
    from dualbend.scenario import shipped

    if not asked:
        raise InputError(f"run needs a SCENARIO: {', '.join(shipped.descriptions())}, or a file")
    click.echo(shipped.table())
    click.echo("\nRun one, for example: dualbend run fig8 --out runs/fig8")


def _write(
    result: RunRecord, kept: RunFolder, record: bool, picture: LiveRecording | None
) -> list[str]:
    """Write the results of a run and print its metrics; return a message for each failed file."""
    from dualbend.report.results import write_results

    notes = None
    if picture is not None:
        from dualbend.recording.notes import notes_of

        notes = notes_of(result)
        picture.end(result, notes)
        if picture.problem is not None:
            click.echo(f"dualbend: --view: the live view ended: {picture.problem}", err=True)
    failures = write_results(result, kept, record=record, notes=notes)
    folder = kept.folder
    show_end(result)
    for name, metric in result.metrics.items():
        note = f"  ({metric.note})" if metric.note else ""
        click.echo(f"  {name:<26}{shown(metric.value):>12}  {metric.unit}{note}")
    _show_sheet(result.summary.sheet)
    if record and result.simulated_s > 0.0 and (folder / "run.rrd").is_file():
        size = (folder / "run.rrd").stat().st_size / 1e6
        per_minute = 60.0 * size / result.simulated_s
        click.echo(f"run.rrd: {size:.2f} MB, {per_minute:.2f} MB per simulated minute")
    click.echo(f"results in {folder}")
    return failures


def _show_sheet(sheet: dict[str, Any]) -> None:
    """Print the effect of each kind of rigidity, and whether the elastic theory applies."""
    others = ", ".join(
        f"{kind} {choice['end_force_change_percent']:+.2g} % end force"
        for kind, choice in sheet["choices"].items()
        if kind != sheet["rigidity"]
    )
    taken = sheet["choices"][sheet["rigidity"]]
    click.echo(
        f"  sheet as a {sheet['rigidity']}: {taken['bending_stiffness_nm2']:.4g} N m² "
        f"({taken['over_beam']:.4g} EI); as {others}"
    )
    if sheet["theory"] != "applies":
        click.echo(f"  elastic theory {sheet['theory']}")


@command("dualbend render pwb --out pwb.gif --speed 4")
@SCENARIO
@click.option("--out", type=PATH, required=True, help=".gif, .mp4 or .png file.")
@SETTINGS
@SEED
@click.option("--camera", help="Camera of the scene: front; bed, in an assembly.")
@click.option("--fps", type=NUMBER, default=10.0, show_default=True, help="Frames per second.")
@click.option("--speed", type=NUMBER, default=4.0, show_default=True, help="Speed over real time.")
@click.option("--width", type=int, default=480, show_default=True, help="Width in pixels (16:9).")
@click.option(
    "--at", "at_s", type=Number(min=0.0), help="Time of the picture [s]; default: the end."
)
@click.option("--inset/--no-inset", default=True, help="Show a pin close up, in an assembly.")
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
    """Save a picture or video of a run, without a screen.

    The extension of --out decides: .gif and .mp4 are a video, .png a picture.
    """
    from dualbend.recording.pictures import offscreen

    offscreen.prepare()  # before anything imports MuJoCo

    from dualbend.recording.pictures.render import Look, check_look, write_video
    from dualbend.run.make import make_run

    look = Look(camera=camera, fps=fps, speed=speed, width_px=width, at_s=at_s, inset=inset)
    ready = make_run(load(scenario, settings, seed))
    check_look(look, ready, out)
    result = ready.run()
    frames = write_video(result, out, look)
    show_end(result)
    click.echo(f"{out}: {frames} frame{'s' if frames > 1 else ''}")
    exit_by(result)


@command("dualbend view fig8 --set motion.speed_rad_per_s=0.2")
@SCENARIO
@SETTINGS
def view(scenario: str, settings: tuple[str, ...]) -> None:
    """Run a scenario in MuJoCo's viewer.

    It runs in real time and needs a screen.
    """
    from dualbend.run.make import make_run

    if not _has_screen():
        raise InputError("view needs a screen; without one, dualbend run writes run.rrd instead")
    from dualbend.recording.viewer import run_in_viewer

    result = run_in_viewer(make_run(load(scenario, settings)))
    click.echo(f"{result.outcome} {result.reason}".rstrip())
    show_warnings(result.scenario.name, result.summary.warnings)
    exit_by(result)


@command("dualbend scene fig8 --out fig8.xml")
@SCENARIO
@click.option("--out", type=PATH, required=True, help="MJCF file to write.")
@SETTINGS
def scene(scenario: str, out: Path, settings: tuple[str, ...]) -> None:
    """Write the composed MJCF of a scenario.

    The key frame "start" is the state at the start of the run.
    """
    from dualbend.run.make import make_run

    xml = make_run(load(scenario, settings)).scene_xml()
    with writing(out, "--out"):
        write_whole(out, xml)
    click.echo(f"{out}: open it with python -m mujoco.viewer --mjcf={out}")


@command("dualbend benchmark fig8 --repeat 3", "dualbend benchmark fig8 --worlds 64")
@click.argument("scenario", default="fig8", shell_complete=complete_scenarios)
@SETTINGS
@click.option("--repeat", type=click.IntRange(1, 1000), default=5, help="Number of repetitions.")
@click.option(
    "--device",
    help="Instead, replay the run in many worlds there with MuJoCo Warp: cuda, cuda:1, cpu.",
)
@click.option(
    "--worlds",
    type=click.IntRange(1),
    help="Instead, as many closed loops as one batch; on a device, 1024 by default.",
)
def benchmark(
    scenario: str,
    settings: tuple[str, ...],
    repeat: int,
    device: str | None,
    worlds: int | None,
) -> None:
    """Compare the loop's time with that of bare mj_step calls.

    Both go through the same states of the same model, alternately in one process. With --worlds a
    batch is compared with a run alone.
    """
    from dualbend.study.benchmark import benchmark as measure

    loaded = load(scenario, settings)
    if device is None and worlds is None:
        rates = measure(loaded, repeat)
    elif device is None:
        from dualbend.batch.benchmark import benchmark_batch

        rates = benchmark_batch(loaded, worlds or 1)
    else:
        from dualbend.batch.gpu.benchmark import benchmark_device

        rates = benchmark_device(
            loaded, worlds or 1024, device, lambda note: click.echo(note, err=True)
        )
    for name, value in rates.items():
        spec = ">12.4g" if isinstance(value, float) else ">12"
        click.echo(f"{name:<28}{value:{spec}}")
