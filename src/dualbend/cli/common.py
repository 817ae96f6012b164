"""Shared by the commands: exit codes, options, examples, one message for bad input."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from dualbend.cli.completion import complete_scenarios, complete_settings
from dualbend.cli.process import lost, signals_raised, whole_streams
from dualbend.errors import DualbendError, shortened, writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar

    from dualbend.run.record import RunRecord
    from dualbend.scenario.scenario import Scenario

_EXAMPLES_HEADING = "\b\nExample:"
"""The control character prevents click from joining the following lines to a paragraph."""

EXIT_FAILED_CHECK, EXIT_BAD_INPUT, EXIT_UNEXPECTED, EXIT_INTERRUPTED = 1, 2, 3, 130


class _Path(click.Path):
    """A path that is not empty: an empty one would be the present folder."""

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - click's own
        """Refuse what a script's empty variable gives."""
        if not os.fspath(value):
            self.fail("is empty; give a path", param, ctx)
        return super().convert(value, param, ctx)


class Number(click.FloatRange):
    """A finite number, within bounds where there are some."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 - click's own
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - click's own
        """Refuse infinities, and what is no number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} must be a finite number", param, ctx)
        return number


_LONGEST_USAGE = 300
"""Characters of what is wrong with an option, before the hint at the help."""

PATH = _Path(path_type=Path)
FILE = _Path(path_type=Path, dir_okay=False)
FOLDER = _Path(path_type=Path, file_okay=False)
NUMBER = Number()


SCENARIO = click.argument("scenario", shell_complete=complete_scenarios)
SETTINGS = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH.TO.KEY=VALUE",
    shell_complete=complete_settings,
    help="Change one key of the scenario; may be given more than once.",
)
SEED = click.option("--seed", type=click.IntRange(min=0), help="Seed of the sensor noise.")
WORKERS = click.option(
    "--workers", type=click.IntRange(1, 256), help="Processes; default: one per core."
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
MARKDOWN_TABLE = click.option(
    "--markdown", is_flag=True, help="Print the table of the documentation."
)
OUT_FILE = click.option("--out", type=PATH, help="File to write; default: print.")


def examples(*lines: str) -> str:
    """Return the example lines of a help text, each as it is typed."""
    return "\n".join((_EXAMPLES_HEADING, *(f"  {line}" for line in lines)))


def command(*lines: str, name: str | None = None) -> Callable[[Callable[..., None]], click.Command]:
    """Make a function a command whose help ends with these examples."""
    return click.command(name, epilog=examples(*lines))


class Commands(click.Group):
    """A group of commands that reports bad input by one message and exit code 2."""

    def __call__(self, *args: Any, **extra: Any) -> NoReturn:  # noqa: ANN401 - click's own
        """Run the command line as a process of its own."""
        code: str | int | None = None
        with whole_streams() as output, signals_raised() as came:
            try:
                self.main(*args, **extra)
            except SystemExit as end:
                code = end.code
            except KeyboardInterrupt:  # before or after there was a command
                pass
            sys.stdout.flush()
            if reason := lost(output):
                _tell(reason)
                code = code or EXIT_BAD_INPUT
        sys.exit(128 + came[0] if came else code)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the options before the command."""
        with _one_line_usage():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command of the command line."""
        try:
            with _one_line_usage():
                return super().invoke(ctx)
        except (KeyboardInterrupt, Exception) as error:
            if _interrupted(error):
                _tell("interrupted")
                sys.exit(EXIT_INTERRUPTED)
            if isinstance(error, DualbendError):
                _tell(str(error))
            elif isinstance(error, MemoryError):
                _tell("there is not memory enough for this")
            elif isinstance(error, RecursionError):
                _tell("the input is nested too deep")
            elif isinstance(error, OSError):
                _tell(": ".join(str(s) for s in (error.filename, error.strerror or error) if s))
            elif "MUJOCO_GL" in str(error):  # MuJoCo reads it when it is imported
                _tell(f"{error}; unset it, or take egl, osmesa or glfw")
            else:
                raise
        sys.exit(EXIT_BAD_INPUT)


def _tell(message: str) -> None:
    click.echo(f"dualbend: {shortened(message)}", err=True)


@contextmanager
def _one_line_usage() -> Iterator[None]:
    """Say in one line what click says of a wrong option in four."""
    try:
        yield
    except click.exceptions.NoArgsIsHelpError:
        raise
    except click.UsageError as error:
        path = "dualbend" if error.ctx is None else error.ctx.command_path
        said = shortened(error.format_message(), _LONGEST_USAGE).rstrip(".?")
        _tell(f"{said}; {path} --help shows what there is")
        sys.exit(EXIT_BAD_INPUT)


def _interrupted(error: BaseException | None) -> bool:
    """Return whether an error is an interrupt, also one that a compiled library converted."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def deliver(text: str, out: Path | None) -> None:
    """Print a text, or write it to a file."""
    if out is None:
        click.echo(text, nl=False)
        return
    with writing(out, "--out"):
        write_whole(out, text)
    click.echo(f"{out} written")


def print_json(value: object) -> None:
    """Print structs, lists and dictionaries; a number that is not finite is null."""
    import msgspec

    click.echo(msgspec.json.format(msgspec.json.encode(value), indent=2).decode())


def load(scenario: str, settings: tuple[str, ...], seed: int | None = None) -> Scenario:
    """Return the scenario that the command line names, with its settings."""
    from dualbend.evaluation.warnings import name_warnings
    from dualbend.scenario.load import load_scenario

    loaded = load_scenario(scenario, settings, seed)
    show_warnings(loaded.name, name_warnings(loaded.sheet))
    return loaded


def show_warnings(name: str, warnings: Sequence[str]) -> None:
    """Print warnings on a scenario to the standard error, each once in a command."""
    told = click.get_current_context().meta.setdefault("dualbend.warnings", set())
    for warning in warnings:
        line = f"warning: {name}: {warning}"
        if line not in told:
            told.add(line)
            click.echo(line, err=True)


def show_end(result: RunRecord) -> None:
    """Print how a run ended, and those of its warnings that were not printed before it."""
    ended = f" ({result.reason})" if result.reason else ""
    click.echo(f"{result.scenario.name}: {result.outcome}{ended}")
    show_warnings(result.scenario.name, result.summary.warnings)


def progress_bar(length: int, label: str) -> ProgressBar[int]:
    """Return a bar that a terminal shows, and a log does not."""
    return click.progressbar(
        length=length, label=label, file=sys.stderr, hidden=not sys.stderr.isatty()
    )


def exit_by(result: RunRecord) -> None:
    """Exit with the code of a run that a signal ended, or otherwise than its scenario expects."""
    if result.signal:
        sys.exit(128 + result.signal)
    if not result.expected:
        sys.exit(EXIT_UNEXPECTED)


def exit_interrupted(done: int, total: int | None, folder: Path) -> NoReturn:
    """Exit from a study, of which the runs that are done are kept."""
    said = f"after {done} of {total} runs, kept in {folder}" if done else "before a run was done"
    click.echo(f"dualbend: interrupted {said}; the same command continues", err=True)
    sys.exit(EXIT_INTERRUPTED)


def shown(value: float | list[float | None] | None) -> str:
    """Return a metric's value in four digits; a dash where there is none."""
    if isinstance(value, list):
        return " ".join(shown(item) for item in value) or "-"
    return "-" if value is None else f"{value:.4g}"
