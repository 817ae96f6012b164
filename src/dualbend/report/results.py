"""Everything that a run leaves in its folder."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dualbend.report.figures import plot_moment
from dualbend.run import output
from dualbend.run.record import RunRecord

if TYPE_CHECKING:
    from dualbend.recording.notes import Notes


def write_results(
    result: RunRecord,
    folder: Path | str,
    *,
    record: bool = True,
    notes: Notes | None = None,
) -> list[str]:
    """Write scenario, trace, summary, picture and recording of a run, however it ended.

    Returns a message for each file that could not be written. The folder is made where it is not
    there. ``record``: ``run.rrd`` as well; ``notes``: what
    :func:`~dualbend.recording.notes.notes_of` returned, where that is known already.

    Raises InputError where the folder cannot be written to.
    """
    folder = Path(folder)
    output.prepare_folder(folder)
    writers: dict[str, Callable[[Path], None]] = {
        "scenario.toml": partial(output.write_scenario, result),
        "trace.parquet": partial(output.write_trace, result),
        "summary.json": partial(output.write_summary, result),
        "moment.png": partial(plot_moment, result),
    }
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
            write(folder / name)
        except OSError as error:
            failures.append(f"--out {folder}: {name}: {error.strerror or error}")
    return failures
