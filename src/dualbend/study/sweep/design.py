"""The runs of a sweep: which values every run has, fixed by the file alone.

For Sobol's indices the runs are those of A. Saltelli et al., Computer Physics Communications 181
(2010) 259-270, table 2: two samples A and B of n, and for each key i a sample AB_i, which is A with
the key's values of B.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from dualbend.errors import InputError
from dualbend.scenario.toml_text import toml
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.keys import OPTION, Range, Values, drawn, known_keys
from dualbend.types import Vector

MOST_RUNS = 100_000


@dataclass(frozen=True, kw_only=True)
class Design:
    """The runs: ``rows[i]`` has run i's values, in the order of ``names``.

    ``seeds``: of the sensors' noise, one a run, or empty where all have the scenario's.
    """

    names: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    seeds: list[int]

    def settings(self, index: int) -> tuple[str, ...]:
        """Return what ``--set`` would be given for a run."""
        pairs = zip(self.names, self.rows[index], strict=True)
        return tuple(f"{name}={toml(value)}" for name, value in pairs)

    def seed(self, index: int) -> int | None:
        """Return what ``--seed`` would be given for a run, if anything."""
        return self.seeds[index] if self.seeds else None


def make_design(sweep: Sweep) -> Design:
    """Return the runs of a sweep.

    A grid's last key varies fastest. Raises InputError where there are too many, or where the
    columns of a list have not as many values.
    """
    sample = sweep.sample
    rows = _combined(sweep) if sample.n is None else _sampled(sweep, sample.n)
    seeds = [_seed(sample.seed, i) for i in range(len(rows))] if sample.noise == "each" else []
    if seeds and "seed" in sweep.keys:
        raise InputError(f'{sweep.source}: keys.seed: sample.noise = "each" gives it as well')
    return Design(names=tuple(sweep.keys), rows=rows, seeds=seeds)


def _combined(sweep: Sweep) -> list[tuple[Any, ...]]:
    """Return the runs of a grid or a list, whose file has no distributions."""
    levels = {
        name: _of_kind(name, spec.levels())
        for name, spec in sweep.keys.items()
        if isinstance(spec, Values | Range)
    }
    lengths = {name: len(values) for name, values in levels.items()}
    if sweep.sample.kind == "list":
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise InputError(f"{sweep.source}: a list's keys need as many values each: {said}")
        return list(zip(*levels.values(), strict=True))
    _refuse_too_many(sweep, math.prod(lengths.values()))
    for name, values in levels.items():
        texts = Counter(map(toml, values))
        twice = [text for text, count in texts.items() if count > 1]
        if twice:
            raise InputError(f"{sweep.source}: keys.{name}: values has {twice[0]} twice")
    return list(itertools.product(*levels.values()))


def _refuse_too_many(sweep: Sweep, count: int) -> None:
    if count > MOST_RUNS:
        raise InputError(f"{sweep.source}: {count} runs; the most are {MOST_RUNS}")


def _sampled(sweep: Sweep, n: int) -> list[tuple[Any, ...]]:
    """Return the runs of a random or a Sobol sample."""
    sample, d = sweep.sample, len(sweep.keys)
    _refuse_too_many(sweep, n * (d + 2) if sample.sensitivity else n)
    rng = np.random.default_rng(sample.seed)
    if sample.kind == "random":
        u = rng.random((n, d))
    else:
        # 64 bits, or a key's value could repeat in long sequences.
        u = qmc.Sobol(2 * d if sample.sensitivity else d, bits=64, seed=rng).random(n)
    if sample.sensitivity:
        u = saltelli(u[:, :d], u[:, d:])
    drawn_of = ((name, drawn(spec, u[:, i])) for i, (name, spec) in enumerate(sweep.keys.items()))
    return list(zip(*(_of_kind(name, values) for name, values in drawn_of), strict=True))


def saltelli(a: Vector, b: Vector) -> Vector:
    """Return A, B, AB_1 … AB_d, one below the other, (n (d + 2), d) of samples (n, d)."""
    crossed = []
    for i in range(a.shape[1]):
        ab = a.copy()
        ab[:, i] = b[:, i]
        crossed.append(ab)
    return np.concatenate([a, b, *crossed])


def _of_kind(name: str, values: list[Any]) -> list[Any]:
    """Make whole numbers of a range's for a key that takes nothing else, or perhaps."""
    found = known_keys().get(name)
    whole = found is not None and found.kind == "whole number"
    if not (whole or name.startswith(OPTION)):
        return values
    return [int(v) if isinstance(v, float) and v.is_integer() else v for v in values]


def _seed(seed: int, index: int) -> int:
    """Return a run's own seed: child ``index`` of the file's, whatever the other runs are."""
    child = np.random.SeedSequence(seed, spawn_key=(index,))
    return int(np.random.default_rng(child).integers(2**31))
