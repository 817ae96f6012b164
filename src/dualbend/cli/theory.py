"""Commands that ask the theory or hold the simulation against it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.cli.common import EXIT_FAILED_CHECK, examples

if TYPE_CHECKING:
    from dualbend.analysis.validation import Row


@click.command(
    epilog=examples(
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


@click.command(epilog=examples("dualbend validate --json", "dualbend validate --arm ur5"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--arm", metavar="NAME", help="Measure one arm of dualbend arms instead.")
def validate(as_json: bool, arm: str | None) -> None:
    """Measure how far simulation is from theory.

    Takes a minute or two; exit code 1 where a row fails.
    """
    from dualbend.analysis.validation import run_arm_validation, run_validation

    on_row = None if as_json else _show_row
    rows = run_validation(on_row) if arm is None else run_arm_validation(arm, on_row)
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


@click.command(epilog=examples("dualbend audit --out docs/audit.md"))
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
