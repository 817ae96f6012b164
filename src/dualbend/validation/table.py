"""The validation table: how far the simulation is from theory, measured when it is asked for.

Every row comes from a small function of a module beside this one; nothing in it is a stored result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from dualbend.arm.model import PUMA, arm_model
from dualbend.validation.cases import (
    arm,
    assembly,
    cell,
    material,
    modes,
    properties,
    runs,
    sheet,
    space,
    urdf,
)
from dualbend.validation.cases import shell as plate
from dualbend.validation.row import Row

__all__ = ["Row", "run_arm_validation", "run_validation"]


def run_validation(
    on_row: Callable[[Row], None] | None = None, *, shell: bool = False
) -> list[Row]:
    """Return all rows; call ``on_row`` with each as soon as it is known. Takes two minutes.

    With ``shell`` the rows are those of the plate instead, which take a minute.
    """
    return _collect(_shell_rows() if shell else _rows(), on_row)


def run_arm_validation(
    name: str, on_row: Callable[[Row], None] | None = None, settings: Sequence[str] = ()
) -> list[Row]:
    """Return the rows of one arm, as :func:`run_validation` does. Takes 30 s on one core.

    ``name``: of a shipped arm, or its file; ``settings`` say what the file does not. Raises
    InputError where there is no such arm, or it cannot do the paper's experiment.
    """
    return _collect(urdf.arm_rows(name, settings), on_row)


def _collect(found: Iterator[Row], on_row: Callable[[Row], None] | None) -> list[Row]:
    rows = []
    for row in found:
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def _shell_rows() -> Iterator[Row]:
    yield from properties.shell_rows()
    yield from plate.shell_rows()


def _rows() -> Iterator[Row]:
    yield from properties.strip_rows()
    yield from properties.material_rows()
    yield from sheet.load_rows()
    yield sheet.order_row("sheet force", sheet.convergence_order())
    yield from material.laminate_rows()
    yield from material.springback_rows()
    yield from modes.frequency_rows()
    yield from space.space_rows()
    yield from arm.table_rows()
    yield from properties.arm_rows(arm_model(PUMA))
    yield from cell.response_rows()
    yield from cell.stiffness_rows()
    yield from arm.held_weight_rows()
    yield from cell.weight_rows()
    shipped = runs.run_shipped()
    yield from runs.residual_rows(shipped)
    yield from runs.moment_rows()
    yield from runs.comparison_rows(shipped)
    yield from runs.growth_rows()
    yield runs.repeat_row(shipped["fig8"])
    yield from material.cell_rows()
    yield from assembly.assembly_rows()
