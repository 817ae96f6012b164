"""Runs of the window: peaks of each piece and the mean moment of the hold, over those of fig6."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from dualbend.errors import InputError
from dualbend.evaluation.metrics import versions
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.processes import in_processes
from dualbend.table import Table
from fig8.changes import CHANGES, CONTROLLED, NOMINAL, Change
from fig8.constant import Constants

Case = Literal["fig6", "fig8", "B halved", "one constant", "a constant per piece"]
COMPLYING: tuple[Case, ...] = ("fig8", "B halved")
_MIXED: tuple[Case, ...] = ("fig6", "fig8")
CONTROLS: tuple[Case, ...] = ("one constant", "a constant per piece")
_HALVED = ("compliance.rotation.b=0.25",)

HOLD_LIMIT = 0.65
"""What the mean moment of the hold may be, over that of fig6."""

MEDIAN_LIMIT = 0.72
"""What the median over the seeds of the worst piece may be, over that of fig6."""

TAILS = (("95th percentile", 0.95, 0.85), ("largest", 1.0, 1.0))
"""Quantiles over the mixtures, and what the worst piece may be there, over fig6."""

Key = tuple[tuple[str, ...], Case, int]
"""Settings, case, seed."""


class Ran(msgspec.Struct, frozen=True, kw_only=True):
    """One run: largest |moment| of each piece [N m], |mean moment| of the hold's second half.

    ``ended``: outcome, or why it was refused; then, and where it stopped, numbers may be missing.
    """

    settings: tuple[str, ...]
    case: Case
    seed: int
    ended: str
    pieces_nm: tuple[float | None, ...] = ()
    hold_nm: float | None = None

    @property
    def key(self) -> Key:
        """What the run is of."""
        return self.settings, self.case, self.seed


def run_one(settings: tuple[str, ...], case: Case, seed: int) -> Ran:
    """Make one run."""
    try:
        result = _run(settings, case, seed)
    except InputError as error:
        return Ran(settings=settings, case=case, seed=seed, ended=f"refused: {error}")
    pieces, hold = (
        result.metrics[name].value for name in ("peak_moment_by_piece", "mean_moment_hold")
    )
    assert isinstance(pieces, list)
    assert not isinstance(hold, list)
    return Ran(
        settings=settings,
        case=case,
        seed=seed,
        ended=result.outcome,
        pieces_nm=tuple(pieces),
        hold_nm=hold,
    )


def _run(settings: tuple[str, ...], case: Case, seed: int) -> RunRecord:
    if case in CONTROLS:
        # The means of the run without a change: a constant cannot know of one.
        unchanged = make_run(load_scenario("fig8", seed=seed)).run()
        constants = Constants.of(unchanged, one=case == CONTROLS[0])
        scenario = load_scenario("fig6", settings, seed)
        return make_run(scenario, compliance=lambda _: constants).run()
    name = "fig6" if case == "fig6" else "fig8"
    halved = _HALVED if case == "B halved" else ()
    return make_run(load_scenario(name, [*settings, *halved], seed)).run()


def design(
    changes: Sequence[Change], controlled: Sequence[Change], seeds: int, mixtures: int = 0
) -> Iterator[Key]:
    """Yield every run: changes with seed 1, the controls, then no change with other seeds.

    Beyond ``seeds``, up to ``mixtures``, only ``fig6`` and ``fig8`` are run.
    """
    own: tuple[Case, ...] = ("fig6", *COMPLYING)
    for change in dict.fromkeys((*changes, *controlled)):
        yield from ((change.settings, case, 1) for case in own)
    for change in controlled:
        yield from ((change.settings, case, 1) for case in CONTROLS)
    for seed in range(2, seeds + 1):
        yield from ((NOMINAL.settings, case, seed) for case in own)
    for seed in range(max(seeds, 1) + 1, mixtures + 1):
        yield from ((NOMINAL.settings, case, seed) for case in _MIXED)


def run_window(
    folder: Path,
    *,
    seeds: int,
    mixtures: int = 0,
    workers: int | None = None,
    changes: Sequence[Change] = CHANGES,
    controlled: Sequence[Change] = CONTROLLED,
    on_run: Callable[[int, int, Ran | None], None] = lambda *_: None,
) -> dict[Key, Ran]:
    """Make the runs that the folder does not have yet; return all, by what they are of.

    Raises InputError where the folder is another study's or cannot be used.
    """
    study = Study(
        design=list(design(changes, controlled, seeds, mixtures)),
        task=lambda key: key,
        run_one=run_one,
        key=lambda row: row.key,
    )
    scenarios = {name: load_scenario(name).to_toml() for name in ("fig6", "fig8")}
    kept = StudyFolder(folder=folder, row=Ran, study={"versions": versions(), **scenarios})
    return {row.key: row for row in study.run(in_processes(workers), kept, on_run)}


class Ratio(msgspec.Struct, frozen=True):
    """A run over ``fig6`` changed alike: peaks of the pieces, mean of the hold, or why not.

    Over several seeds each number is a quantile of its own: ``worst`` is that of each seed's worst
    piece, so that it may lie above every entry of ``pieces``.
    """

    pieces: tuple[float, ...] = ()
    hold: float | None = None
    worst: float | None = None
    why_not: str = ""


def ratio(runs: dict[Key, Ran], change: Change, case: Case, seed: int = 1) -> Ratio:
    """Return a case over ``fig6`` with the same change and seed."""
    before, after = (runs[change.settings, which, seed] for which in ("fig6", case))
    for run in (before, after):
        if run.ended != "completed":
            return Ratio(why_not=f"{run.case}: {run.ended}")
    both = zip(after.pieces_nm, before.pieces_nm, strict=True)
    pieces = [a / b for a, b in both if a is not None and b]
    held = after.hold_nm / before.hold_nm if after.hold_nm and before.hold_nm else None
    return Ratio(tuple(pieces), held, max(pieces, default=None))


def window_table(
    runs: dict[Key, Ran], seeds: int, changes: Sequence[Change] = CHANGES, mixtures: int = 0
) -> Table:
    """Return the worst piece and the hold of each change; what does not hold is in bold."""
    headings = ["change"]
    for case in COMPLYING:
        headings += [f"{case}: pieces", "worst", "hold"]
    rows: list[list[object]] = []
    for change in changes:
        row: list[object] = [change.name]
        for case in COMPLYING:
            row += _cells(ratio(runs, change, case), change.limit, gated=case == "fig8")
        rows.append(row)
    row = [f"median of seeds 1-{seeds}"]
    for case in COMPLYING:
        row += _cells(over_seeds(runs, case, seeds, 0.5), MEDIAN_LIMIT, gated=case == "fig8")
    rows.append(row)
    row = [f"rms over seeds 1-{seeds}"]
    for case in COMPLYING:
        row += _cells(rms_over_seeds(runs, case, seeds), 1.0, gated=False)
    rows.append(row)
    mixtures = max(seeds, mixtures)
    for said, share, limit in TAILS:
        found = over_seeds(runs, "fig8", mixtures, share)
        rows.append([f"{said} of seeds 1-{mixtures}", *_cells(found, limit, gated=True), *"---"])
    return Table(headings, rows)


def control_table(runs: dict[Key, Ran], changes: Sequence[Change]) -> Table:
    """Return feedback beside constants: ratios of each piece and of the hold."""
    rows = [
        [change.name, case, *_cells(ratio(runs, change, case), change.limit, gated=False)]
        for change in changes
        for case in ("fig8", *CONTROLS)
    ]
    return Table(("change", "what turns the grips", "pieces", "worst", "hold"), rows)


def over_seeds(runs: dict[Key, Ran], case: Case, seeds: int, share: float) -> Ratio:
    """Return a quantile over the seeds of the ratio of each piece, and of the hold.

    Each seed draws other imperfections: the seeds are random mixtures of them.
    """
    found = [ratio(runs, NOMINAL, case, seed) for seed in range(1, seeds + 1)]
    for one in found:
        if one.why_not:
            return one
    pieces = np.quantile([one.pieces for one in found], share, axis=0).tolist()
    holds, worst = (
        [value for value in of if value is not None]
        for of in ([one.hold for one in found], [one.worst for one in found])
    )
    return Ratio(
        tuple(pieces),
        float(np.quantile(holds, share)) if holds else None,
        float(np.quantile(worst, share)) if worst else None,
    )


def rms_over_seeds(runs: dict[Key, Ran], case: Case, seeds: int) -> Ratio:
    """Return the rms over the seeds of each piece's peak, and of the hold, over that of fig6.

    Where the imperfections of a seed happen to leave ``fig6`` next to no moment, its ratio says
    little; here each seed counts by its moment.
    """
    each = []
    for which in (case, "fig6"):
        ran = [runs[NOMINAL.settings, which, seed] for seed in range(1, seeds + 1)]
        for run in ran:
            if run.ended != "completed" or run.hold_nm is None:
                return Ratio(why_not=f"seed {run.seed} of {which}: {run.ended}")
        moments = np.array([(*run.pieces_nm, run.hold_nm) for run in ran], dtype=np.float64)
        each.append(np.sqrt((moments**2).mean(axis=0)))
    *pieces, hold = (each[0] / each[1]).tolist()
    return Ratio(tuple(pieces), hold, max(pieces, default=None))


def _cells(found: Ratio, limit: float, *, gated: bool) -> list[str]:
    if found.why_not:
        return [found.why_not, "-", "-"]

    def said(value: float | None, most: float) -> str:
        if value is None:
            return "-"
        return f"**{value:.2f}**" if gated and value > most else f"{value:.2f}"

    pieces = " ".join(f"{value:.2f}" for value in found.pieces)
    return [pieces, said(found.worst, limit), said(found.hold, HOLD_LIMIT)]
