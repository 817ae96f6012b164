"""The section ``[task]``: its kind says what the robots do, and each kind has keys of its own."""

from __future__ import annotations

from abc import ABC
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import msgspec

from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.registry import TASKS
from dualbend.scenario.motion import MotionConfig
from dualbend.scenario.sheet import SheetConfig
from dualbend.scene.bed.config import LayoutConfig
from dualbend.types import Tagged


class TaskConfig(Tagged):
    """What the scenario asks of a task; the struct of each task derives from it, with its tag."""

    @property
    def moves_freely(self) -> bool:
        """The arms do not always bear a load, so that they can tell their own friction."""
        return False

    @property
    def learns(self) -> bool:
        """A path of it can be corrected from sheet to sheet."""
        return False

    @property
    def carried_share(self) -> float:
        """Share of the sheet's weight that one arm alone must be able to bear."""
        return 0.5

    @property
    def workplace(self) -> LayoutConfig | None:
        """Bed, pins and stand as they really are; None: there are none."""
        return None

    @property
    def laid_sheets(self) -> int:
        """Number of sheets that come to lie in the cell beside the one that is held."""
        return 0

    def check(self, sheet: SheetConfig, motion: MotionConfig) -> None:
        """Raise InputError where the task cannot be done with this sheet or motion."""

    def true_sheet(self, sheet: Sheet) -> Sheet:
        """Return the sheet as it really is, of the one that the robots believe to hold."""
        return sheet

    def limit_strain(self, known: float | None, sheet: Sheet) -> float | None:
        """Return the surface strain at which a run ends, of the one that the material bears."""
        del sheet
        return known


if TYPE_CHECKING:
    AnyTask = TaskConfig
else:

    class AnyTask(ABC):  # noqa: B024 - a struct registers as one
        """Type of the section in a scenario: which structs it may be is known when it is read."""

    AnyTask.register(TaskConfig)


class TaskKinds(Mapping[str, type[msgspec.Struct]]):
    """The structs of the registered tasks by kind; one that is registered later is here, too."""

    def __getitem__(self, kind: str) -> type[msgspec.Struct]:
        """Return the struct of a kind."""
        try:
            struct: type[msgspec.Struct] = TASKS[kind].config
        except InputError as error:
            raise KeyError(kind) from error
        return struct

    def __iter__(self) -> Iterator[str]:
        """Yield the kinds, the default one first."""
        return iter(TASKS)

    def __len__(self) -> int:
        """Return their number."""
        return sum(1 for _ in TASKS)


def default_task() -> AnyTask:
    """Return the section of a scenario that does not have one."""
    task: AnyTask = TASKS[next(iter(TASKS))].config()
    return task
