"""How a run of a study ends: with a result, refused, or by an error that must not end the study."""

from __future__ import annotations

from typing import Annotated, Final, TypeAlias, get_args

import msgspec

from dualbend.errors import DualbendError
from dualbend.evaluation.metrics import WALL_CLOCK
from dualbend.run.loop import Run
from dualbend.run.record import Metric, RunRecord, whole
from dualbend.scenario.sections import Outcome

REFUSED: Final = "refused"
RAISED: Final = "error"
"""Outcomes beside those of a run: it cannot be made ready, or is broken."""

OUTCOMES = (*get_args(Outcome), REFUSED, RAISED)

Ended: TypeAlias = Annotated[str, msgspec.Meta(pattern=f"^({'|'.join(OUTCOMES)})$")]
"""How a run of a study ended."""


def result_of(run: Run) -> RunRecord:
    """Run to the end; KeyboardInterrupt where the user ended it."""
    return whole(run.run())


def record_of(record: RunRecord | Exception) -> RunRecord:
    """Return one of many records; raise what its run raised, or KeyboardInterrupt as above."""
    if isinstance(record, Exception):
        raise record
    return whole(record)


def metrics_of(result: RunRecord) -> dict[str, Metric]:
    """Return the metrics of a run, without those of the machine."""
    return {name: metric for name, metric in result.metrics.items() if name not in WALL_CLOCK}


def outcome_of(error: Exception) -> tuple[str, str]:
    """Return outcome and reason of a run that an exception ended."""
    if isinstance(error, DualbendError):
        return REFUSED, str(error)
    return RAISED, f"{type(error).__name__}: {error}"
