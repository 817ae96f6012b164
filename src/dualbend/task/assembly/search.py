"""Where holes are tried again that did not find their pins."""

from __future__ import annotations

from dualbend.task.assembly.config import SearchConfig


def search_pattern(search: SearchConfig) -> list[tuple[float, float]]:
    """Return where to try the middle holes, (x, y) [m], relative to their place.

    In place, then along and across on both sides, then the corners; then further out.
    """
    square = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)]
    places = [(0.0, 0.0)]
    for n in range(search.attempts):
        ring, (along, across) = 1 + n // len(square), square[n % len(square)]
        places.append((ring * along * search.step_m, ring * across * search.step_m))
    return places


def side_to_side(search: SearchConfig) -> list[float]:
    """Return how far the outer holes are turned aside [m]: the middle is on its pins already.

    A quarter of the step: what the middle holes' clearance leaves is less than that of a free
    sheet.
    """
    places = [0.0]
    for n in range(search.attempts):
        places.append((1 + n // 2) * (0.25 if n % 2 == 0 else -0.25) * search.step_m)
    return places
