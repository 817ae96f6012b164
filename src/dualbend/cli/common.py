"""Shared by the commands: exit codes, options, examples, one message for bad input."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.errors import DualbendError, writing

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_EXAMPLES_HEADING = "\b\nExample:"
"""The control character prevents click from joining the following lines to a paragraph."""

EXIT_FAILED_CHECK, EXIT_BAD_INPUT, EXIT_UNEXPECTED, EXIT_INTERRUPTED = 1, 2, 3, 130

SETTINGS = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH.TO.KEY=VALUE",
    help="Change one key of the scenario; may be given more than once.",
)


def examples(*lines: str) -> str:
    """Return the example lines of a help text, each as it is typed."""
    return "\n".join((_EXAMPLES_HEADING, *(f"  {line}" for line in lines)))


def complete_scenarios(
    _: click.Context, __: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the shipped scenarios and the TOML files to the shell."""
    from dualbend.scenario.shipped import complete_scenario

    return complete_scenario(incomplete)


class Commands(click.Group):
    """A group of commands that reports bad input by one message and exit code 2."""

    def invoke(self, ctx: click.Context) -> object:
        """Run the command of the command line."""
        try:
            return super().invoke(ctx)
        except DualbendError as error:
            click.echo(f"dualbend: {error}", err=True)
            sys.exit(EXIT_BAD_INPUT)
        except (KeyboardInterrupt, Exception) as error:
            if not _interrupted(error):
                raise
            click.echo("dualbend: interrupted before there was a result", err=True)
            sys.exit(EXIT_INTERRUPTED)


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
        out.write_text(text, encoding="utf-8")
    click.echo(f"{out} written")


def shown(value: float | list[float | None] | None) -> str:
    """Return a metric's value in four digits; a dash where there is none."""
    if isinstance(value, list):
        return " ".join(shown(item) for item in value) or "-"
    return "-" if value is None else f"{value:.4g}"
