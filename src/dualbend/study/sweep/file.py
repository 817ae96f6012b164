"""The sweep file: which scenario, which of its keys vary, and how; typed and strict.

Every error is an :class:`~dualbend.errors.InputError` with the file, the key, the value and what
would be right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import tomli_w

from dualbend.errors import InputError, brief, refusing, shortened
from dualbend.scenario.explain import UNSET, converted, nearest, refuse_renamed
from dualbend.scenario.keys import Key
from dualbend.scenario.load import read_scenario, resolve_scenario
from dualbend.scenario.scenario import Scenario, without_none
from dualbend.scenario.toml_text import read_toml, toml
from dualbend.study.sweep.keys import (
    OPTION,
    Normal,
    Range,
    Spec,
    Uniform,
    Values,
    is_spec,
    known_keys,
    make_spec,
)
from dualbend.types import Config

SWEEP, SCENARIO = "sweep.toml", "scenario.toml"
"""Files that a sweep leaves in its folder: the same sweep, complete."""

_DRAWN = ("random", "sobol")


class SampleConfig(Config):
    """How the keys' values are put together to runs.

    ``noise``: "same" noise of the sensors in every run, or of a seed of its own in "each".
    ``sensitivity``: the sample from which Sobol's indices are computed, n (d + 2) runs for d keys.
    """

    kind: Literal["grid", "list", "random", "sobol"]
    n: Annotated[int, msgspec.Meta(ge=1, le=100_000)] | None = None
    seed: Annotated[int, msgspec.Meta(ge=0)] = 1
    noise: Literal["same", "each"] = "same"
    sensitivity: bool = False

    def __post_init__(self) -> None:
        """Refuse what the kind has no use for, or lacks."""
        if (self.n is None) == (self.kind in _DRAWN):
            has = "needs n" if self.n is None else "has as many runs as its keys say, not n"
            raise ValueError(f'kind = "{self.kind}" {has}')
        if self.kind == "sobol" and self.n is not None and self.n & (self.n - 1):
            below = 1 << (self.n.bit_length() - 1)
            raise ValueError(
                f"n = {self.n} is no power of two, as Sobol's sequence needs: "
                f"{below} or {2 * below}"
            )
        if self.sensitivity and self.kind != "sobol":
            raise ValueError(f'sensitivity needs kind = "sobol", not "{self.kind}"')


class SweepConfig(Config):
    """The file as it is written; ``metrics`` are those that table and pictures show."""

    scenario: Annotated[str, msgspec.Meta(min_length=1)]
    name: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9][\w.+-]*\Z", max_length=100)] | None = (
        None
    )
    description: str = ""
    metrics: tuple[str, ...] = ()
    settings: dict[str, Any] = msgspec.field(default={}, name="set")
    sample: SampleConfig
    keys: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A sweep: everything that can be refused before a run has been when this exists.

    ``tables``: the scenario as it was written; ``settings``: as ``--set`` takes them.
    """

    name: str
    source: str
    config: SweepConfig
    tables: Mapping[str, Any]
    settings: tuple[str, ...]
    keys: Mapping[str, Spec]

    @property
    def sample(self) -> SampleConfig:
        """How the runs are put together."""
        return self.config.sample

    def resolve(self, settings: tuple[str, ...] = (), seed: int | None = None) -> Scenario:
        """Return the scenario with the fixed and these settings; InputError as of ``--set``."""
        # Named as it names itself: the same reason from the sweep's file and from its folder.
        source = str(self.tables.get("name"))
        return resolve_scenario(self.tables, source, self.settings + settings, seed)

    def to_toml(self, *, all_of_it: bool = True) -> str:
        """Return the file that, beside :meth:`scenario_toml`, is this sweep.

        Without ``all_of_it`` only what the runs depend on.
        """
        said: dict[str, Any] = {"scenario": SCENARIO}
        if all_of_it:
            said |= {"name": self.name, "description": self.config.description}
            said["metrics"] = list(self.config.metrics)
        said |= {"set": self.config.settings, "sample": self.sample, "keys": self.keys}
        return tomli_w.dumps(without_none(msgspec.to_builtins(said)))

    def scenario_toml(self) -> str:
        """Return the scenario as it was written, with those that it extends."""
        return tomli_w.dumps(self.tables)


def load_sweep(path: Path) -> Sweep:
    """Load a sweep's file, or the one that a sweep left in its folder."""
    file = path / SWEEP if path.is_dir() else path
    data = read_toml(file, "no sweep's file")
    source = file.name
    config = converted(data, SweepConfig, source)
    keys = {
        name: make_spec(table, source, _short(name))
        for name, table in _leaves(config.keys, is_spec)
    }
    sweep = Sweep(
        name=config.name or path.stem,
        source=source,
        config=config,
        tables=_scenario_tables(config.scenario, file),
        settings=tuple(f"{key}={toml(value)}" for key, value in config.settings.items()),
        keys=keys,
    )
    with refusing(f"{source}: scenario = {config.scenario!r}, [set]"):
        sweep.resolve()
    _check_keys(sweep)
    return sweep


def _short(name: str) -> str:
    """Return a key's name for a message: what a file has there may be long, or have lines."""
    return shortened(name, 80)


def _scenario_tables(scenario: str, file: Path) -> dict[str, Any]:
    """Return the scenario's tables; a file is looked for beside the sweep's."""
    with refusing(f"{file.name}: scenario = {brief(scenario)}", ValueError):
        named = str(file.parent / scenario) if scenario.endswith(".toml") else scenario
        return read_scenario(named)


def _leaves(
    table: Mapping[str, Any], is_leaf: Callable[[Mapping[str, Any]], bool], path: str = ""
) -> Iterator[tuple[str, Any]]:
    """Yield each value by its dotted name, also where TOML made tables of the dots."""
    for name, value in table.items():
        if isinstance(value, dict) and not is_leaf(value):
            yield from _leaves(value, is_leaf, f"{path}{name}.")
        else:
            yield f"{path}{name}", value


def _check_keys(sweep: Sweep) -> None:
    if not sweep.keys:
        raise InputError(f"{sweep.source}: [keys] is empty: it needs a key that varies")
    fixed = [name for name, _ in _leaves(sweep.config.settings, lambda table: not table)]
    for name in sweep.keys:
        for other in (*fixed, *sweep.keys):
            same = other == name and other in fixed
            if same or other.startswith(f"{name}.") or name.startswith(f"{other}."):
                raise InputError(
                    f"{sweep.source}: keys.{_short(name)}: {_short(other)} is given as well; "
                    "only one can hold"
                )
        _check_key(sweep, name)


def _check_key(sweep: Sweep, name: str) -> None:
    """Refuse a key that no scenario has, and values that are of another kind than it."""
    spec, where = sweep.keys[name], f"{sweep.source}: keys.{_short(name)}"
    if sweep.sample.kind in ("grid", "list") and not isinstance(spec, Values | Range):
        raise InputError(
            f"{where}: a distribution is for sample.kind = "
            f'"random" or "sobol", not "{sweep.sample.kind}"'
        )
    known = known_keys()
    if name.startswith(OPTION):
        return  # each run's own class says what it takes
    if name not in known:
        refuse_renamed(name, f"{sweep.source}: [keys]")
        hint = nearest(name, known, most=3)
        raise InputError(f"{where}: no key of a scenario; {hint}docs/reference.md has them all")
    key = known[name]
    if key is None:  # a section
        if not isinstance(spec, Values):
            raise InputError(f"{where}: is a section, not a number: give values")
        return
    if isinstance(spec, Uniform | Normal | Range) and "number" not in key.kind.split()[-1:]:
        raise InputError(f"{where}: is {key.kind}, not a number: give values")
    if isinstance(spec, Uniform | Normal) and key.kind == "whole number":
        raise InputError(f"{where}: is a whole number: give values, or min, max, steps")
    if isinstance(spec, Range) and key.kind == "whole number":
        broken = [value for value in spec.levels() if not value.is_integer()]
        if broken:
            raise InputError(f"{where}: is a whole number, and the range has {broken[0]}")
    for value in spec.values if isinstance(spec, Values) else ():
        _check_value(where, value, key)


def _check_value(where: str, value: object, key: Key) -> None:
    if value == UNSET and key.default is None:
        return
    try:
        msgspec.convert(value, key.type)
    except msgspec.ValidationError as error:
        # Out of its bounds, a value may be refused together with others: that is a run's reason.
        if ", got `" in str(error) or "Invalid enum" in str(error):
            raise InputError(f"{where}: {brief(value)} in values: must be {key.kind}") from error
