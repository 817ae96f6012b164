"""The onset as a threshold of many runs: Spearman and Kärber's estimate.

Near the onset dry friction and the bounds of the deviation make an oscillation wax and wane, so
whether one run grows is partly chance: from 10 % below to 20 % above an onset one run in five says
the opposite of its neighbours. A bisection then ends at whichever change of sign its first
bracket leads to. Here every b of a fixed grid is run, on both sides until the runs agree, and all
of them count. Neither the guess nor the runs beyond, which all say the same, can move the answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from dualbend.errors import InputError

STEP = 0.01
"""From one b of the grid to the next, relative; a single run that errs moves the onset by this."""

AGREEING = 10
"""Runs in a row that must agree at either end of what is scanned."""

_FURTHEST = 8.0
"""How far from the guess an onset is looked for, as a factor."""


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """The onset ``b``: below ``unstable`` every run grows, above ``stable`` none; ``runs`` made."""

    b: float
    unstable: float
    stable: float
    runs: int


def threshold(
    grow: Callable[[Sequence[float]], Iterable[bool]], guess: float, step: float = STEP
) -> Threshold:
    """Return the b below which runs grow; ``grow`` tells it of several b at once.

    ln b = ln b₀ + (n − ½) ln(1 + step), n the number of runs that grow among all from b₀ up, b₀
    the lowest b: for answers that depend on chance the mean of the thresholds that runs have, for
    a sharp one the middle of its step. The grid is (1 + step)^i, whatever the guess is; an onset
    depends on the guess only if :data:`AGREEING` runs in a row agree where others, further on, do
    not. Asked at once is what is needed whatever the answers are: no run more than one by one.

    Raises InputError where the runs do not agree on both sides within a factor of eight.

    Source: Spearman, Brit. J. Psychol. 2 (1908) 227; Kärber, Arch. exp. Path. Pharmak. 162 (1931)
    480; Finney, Statistical Method in Biological Assay (1978), section 18.
    """
    unit = math.log1p(step)
    nearest = round(math.log(guess) / unit)
    furthest = math.floor(math.log(_FURTHEST) / unit)
    found: dict[int, bool] = {}

    def needed(way: int, wanted: bool) -> range:
        """Return the runs that one side needs at the least to agree."""
        in_a_row, i = 0, nearest
        while in_a_row < AGREEING and i in found:
            in_a_row = in_a_row + 1 if found[i] == wanted else 0
            i += way
        if abs(i - nearest) + AGREEING - in_a_row > furthest + 1:
            low, high = sorted((guess, math.exp((nearest + way * (furthest + 1)) * unit)))
            raise InputError(
                f"no onset between b = {low:.3g} and {high:.3g}: nowhere {AGREEING} runs in a "
                f"row that {'grow' if wanted else 'do not grow'}"
            )
        return range(i, i + way * (AGREEING - in_a_row), way)

    while asked := list(dict.fromkeys((*needed(1, wanted=False), *needed(-1, wanted=True)))):
        found.update(zip(asked, grow([math.exp(i * unit) for i in asked]), strict=True))
    least = min(found)
    growing = sum(found.values())
    first_not = min(i for i, it_grows in found.items() if not it_grows)
    last = max(i for i, it_grows in found.items() if it_grows)
    return Threshold(
        b=math.exp((least + growing - 0.5) * unit),
        unstable=math.exp((first_not - 1) * unit),
        stable=math.exp((last + 1) * unit),
        runs=len(found),
    )
