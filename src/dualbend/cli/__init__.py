"""The command line: reads the arguments, calls the package, prints, returns an exit code.

0 completed, or ended as the scenario expects; 1 a validation row or a check fails; 2 bad input; 3 a
protective stop or failed run that the scenario does not expect; 128 + n ended by signal n.
Heavy imports happen inside the commands.
"""

from importlib import import_module

import click

from dualbend.cli.common import Commands, examples


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples("dualbend run fig8 --out runs/fig8", "dualbend run --help"),
)
@click.version_option(package_name="dualbend")
def main() -> None:
    """Two position-controlled arms bend a flexible sheet."""


for _name in (
    "assembly",
    "check",
    "files",
    "learning",
    "logs",
    "report",
    "runs",
    "serve",
    "stability",
    "sweep",
    "theory",
):
    for _command in vars(import_module(f"dualbend.cli.{_name}")).values():
        if isinstance(_command, click.Command):
            main.add_command(_command)
