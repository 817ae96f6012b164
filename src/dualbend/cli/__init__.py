"""The command line: reads the arguments, calls the package, prints, returns an exit code.

0 completed, or ended as the scenario expects; 1 a validation row or a check fails; 2 bad input; 3 a
protective stop or failed run that the scenario does not expect; 130 interrupted before a result.
Heavy imports happen inside the commands.
"""

import click

from dualbend.cli import (
    arms,
    assembly,
    files,
    judge,
    materials,
    report,
    runs,
    stability,
    sweep,
    theory,
)
from dualbend.cli.common import Commands, examples


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples("dualbend run fig8 --out runs/fig8", "dualbend run --help"),
)
@click.version_option(package_name="dualbend")
def main() -> None:
    """Two position-controlled arms bend a flexible sheet."""


for _command in (
    runs.run,
    theory.beam,
    materials.materials,
    theory.validate,
    judge.check,
    judge.compare,
    report.report,
    report.figures,
    files.list_command,
    files.new,
    files.schema,
    files.reference,
    arms.arms,
    runs.scene,
    runs.render,
    runs.view,
    assembly.plan,
    runs.benchmark,
    assembly.robustness,
    sweep.sweep,
    stability.stability,
    stability.tune,
):
    main.add_command(_command)
