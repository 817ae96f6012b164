"""Everything that a run leaves in its folder."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dualbend.errors import InputError
from dualbend.report.figures import plot_moment
from dualbend.run.disk.folder import RunFolder, run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.record import RunRecord

if TYPE_CHECKING:
    from dualbend.recording.notes import Notes


def write_results(
    result: RunRecord,
    folder: RunFolder | Path | str,
    *,
    record: bool = True,
    notes: Notes | None = None,
) -> list[str]:
    """Write scenario, trace, summary, picture and recording of a run, however it ended.

    The first three take the place of an earlier run's together, before anything is drawn. Returns a
    message for a picture or recording that could not be written. ``record``: ``run.rrd`` as well;
    ``notes``: what :func:`~dualbend.recording.notes.notes_of` returned, where that is known
    already.

    Raises InputError where another process writes to the folder or it cannot be written to; then it
    holds what it held.
    """
    with nullcontext(folder) if isinstance(folder, RunFolder) else run_folder(folder) as kept:
        write_numbers(result, kept)
        writers: dict[str, Callable[[Path], None]] = {"moment.png": partial(plot_moment, result)}
        if record:
            # Here, because rerun takes half a second to import.
            from dualbend.recording.notes import notes_of  # noqa: PLC0415
            from dualbend.recording.write import write_recording  # noqa: PLC0415

            notes = notes_of(result) if notes is None else notes
            # Small and with its index, in place of what was streamed.
            writers["run.rrd"] = partial(write_recording, result, notes=notes)
        failures = []
        for name, write in writers.items():
            try:
                write(kept.folder / name)
            except OSError as error:
                failures.append(f"--out {kept.folder}: {name}: {error.strerror or error}")
            except InputError as error:
                failures.append(str(error))
        return failures
