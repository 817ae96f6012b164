"""The validation table: how far the simulation is from theory, measured when it is asked for.

Every row comes from a small function of a module beside this one; nothing in it is a stored result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dualbend.validation.cases import arm as validation_arm
from dualbend.validation.cases import assembly as validation_assembly
from dualbend.validation.cases import cell as validation_cell
from dualbend.validation.cases import material as validation_material
from dualbend.validation.cases import modes as validation_modes
from dualbend.validation.cases import runs as validation_runs
from dualbend.validation.cases import sheet as validation_sheet
from dualbend.validation.cases import shell as validation_shell
from dualbend.validation.cases import space as validation_space
from dualbend.validation.cases import urdf as validation_urdf
from dualbend.validation.row import Row

__all__ = ["Row", "run_arm_validation", "run_validation"]


def run_validation(
    on_row: Callable[[Row], None] | None = None, *, shell: bool = False
) -> list[Row]:
    """Return all rows; call ``on_row`` with each as soon as it is known. Takes two minutes.

    With ``shell`` the rows are those of the plate instead, which take a minute.
    """
    return _collect(validation_shell.shell_rows() if shell else _rows(), on_row)


def run_arm_validation(name: str, on_row: Callable[[Row], None] | None = None) -> list[Row]:
    """Return the rows of one arm, as :func:`run_validation` does. Takes 30 s on one core.

    Raises
    ------
    InputError
        No such arm, or it cannot do the paper's experiment: nothing can be measured then.
    """
    return _collect(validation_urdf.arm_rows(name), on_row)


def _collect(found: Iterator[Row], on_row: Callable[[Row], None] | None) -> list[Row]:
    rows = []
    for row in found:
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def _rows() -> Iterator[Row]:
    yield from validation_sheet.load_rows()
    yield validation_sheet.order_row()
    yield from validation_material.laminate_rows()
    yield from validation_material.springback_rows()
    yield from validation_modes.frequency_rows()
    yield from validation_space.space_rows()
    yield from validation_arm.table_rows()
    yield from validation_cell.response_rows()
    yield from validation_cell.stiffness_rows()
    yield from validation_arm.held_weight_rows()
    yield from validation_cell.weight_rows()
    runs = validation_runs.run_shipped()
    yield from validation_runs.residual_rows(runs)
    yield from validation_runs.moment_rows(runs["fig6"])
    yield from validation_runs.comparison_rows(runs)
    yield validation_runs.repeat_row(runs["fig8"])
    yield from validation_material.cell_rows()
    yield from validation_assembly.assembly_rows()
