"""What a confrontation found, and how it is kept while it is at work."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import msgspec

from dualbend.errors import InputError
from dualbend.study.onset.held import SingleAxis

RESULTS = "confrontation.json"
"""The file that holds the cases; one that is not ours is written anew."""


class Rate(msgspec.Struct, frozen=True, kw_only=True):
    """Growth rates [1/s] at one b; the simulated one is null where no stretch of the run tells."""

    b: float
    predicted_per_s: float
    simulated_per_s: float | None


class Simulated(msgspec.Struct, frozen=True, kw_only=True):
    """What the bisection found: b, the unstable and the stable end of its interval, and more.

    ``frequency_hz`` at the unstable end; ``remains``: rms of the deviation [m] or [rad] that stays
    at 1.1 times the onset, where a linear loop would rest.
    """

    b: float
    unstable_b: float
    stable_b: float
    frequency_hz: float
    remains: float
    rates: tuple[Rate, ...]
    runs: int


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """One axis at one angle on one ray; b in the axis's own units.

    ``*_b``: onset by each analysis; ``sampled_hz``: of the sampled loop at its own onset,
    ``same_gains_hz``: with the gains at which the simulation oscillates; ``simulated``: with dry
    friction, as the scenario runs; ``frictionless``: without that of the joints, null where it was
    not asked for.
    """

    key: str
    axis: SingleAxis
    alpha_rad: float
    ratio_per_s: float
    paper_b: float
    delayed_b: float
    sampled_b: float
    sampled_hz: float
    same_gains_hz: float
    simulated: Simulated
    frictionless: Simulated | None

    def error(self, analysis: str) -> float:
        """Return predicted over simulated onset, less 1; positive is an early warning."""
        predicted: float = getattr(self, f"{analysis}_b")
        return predicted / self.simulated.b - 1.0

    @property
    def frequency_error(self) -> float:
        """Return predicted over simulated frequency with the same gains, less 1."""
        return self.same_gains_hz / self.simulated.frequency_hz - 1.0


class Confrontation(msgspec.Struct, frozen=True, kw_only=True):
    """All cases of one scenario, in the order that was asked for."""

    scenario: str
    cases: tuple[Case, ...]


def kept(folder: Path | None) -> dict[str, Case]:
    """Return what an earlier call left in a folder, by key."""
    if folder is None:
        return {}
    with suppress(OSError, msgspec.MsgspecError):
        cases = msgspec.json.decode((folder / RESULTS).read_bytes(), type=list[Case])
        return {case.key: case for case in cases}
    return {}


def keep(folder: Path, cases: dict[str, Case]) -> None:
    """Write all cases; InputError where the folder cannot be written."""
    partial = folder / f"{RESULTS}.partial"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(msgspec.json.format(msgspec.json.encode(list(cases.values()))))
        partial.replace(folder / RESULTS)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be written: {error.strerror}") from error
