"""A shipped scenario, wrong on purpose."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import msgspec
import tomli_w

from dualbend import list_scenarios, load_scenario
from dualbend.scenario.scenario import without_none

Table = dict[str, Any]
Keys = tuple[str | int, ...]


@cache
def _resolved(name: str) -> Table:
    tables: Table = without_none(msgspec.to_builtins(load_scenario(name)))
    return tables


def mutated(chance: random.Random) -> tuple[str, bytes]:
    """Return what was done to which scenario, and the file that it is then."""
    name = chance.choice(sorted(list_scenarios()))
    whole = chance.random() < 0.5
    tables = copy.deepcopy(_resolved(name)) if whole else {"extends": name, **_part(chance, name)}
    return _changed(chance, tables, name if whole else f"extends {name}")


def mutated_sweep(chance: random.Random) -> tuple[str, bytes]:
    """Return what was done to which kind of sweep, and the file that it is then."""
    tables = copy.deepcopy(chance.choice(_SWEEPS))
    return _changed(chance, tables, f"sweep, {tables['sample']['kind']}")


def _changed(chance: random.Random, tables: Table, what: str) -> tuple[str, bytes]:
    said = [what]
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        with suppress(RecursionError):  # nested twice
            said.append(chance.choice(_CHANGES)(chance, tables))
    try:
        text = tomli_w.dumps(tables)
    except RecursionError:
        text = "a = " + 2000 * "[" + 2000 * "]"
    content = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.25:
        kind = chance.choice(sorted(_FILES))
        said.append(kind)
        content = _FILES[kind](chance, text)
    return ", ".join(said), content


def _part(chance: random.Random, name: str) -> Table:
    """Return some of a scenario's sections."""
    tables = {k: v for k, v in _resolved(name).items() if isinstance(v, dict)}
    return {key: copy.deepcopy(tables[key]) for key in chance.sample(sorted(tables), 2)}


def _places(value: object, above: Keys = ()) -> list[Keys]:
    """Return where every value of a tree is, tables and lists included."""
    items: list[tuple[str | int, object]] = []
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    return [place for k, v in items for place in ((*above, k), *_places(v, (*above, k)))]


def _holder(tables: Table, place: Keys) -> Any:
    for key in place[:-1]:
        tables = tables[key]  # type: ignore[index]
    return tables


def _numbers(tables: Table) -> list[Keys]:
    return [p for p in _places(tables) if type(_holder(tables, p)[p[-1]]) in (int, float)]


def _set(make: Callable[[random.Random, Any], Any], *, numbers: bool = False) -> Any:
    """Return a change that sets one value to what is made of it."""

    def change(chance: random.Random, tables: Table) -> str:
        places = _numbers(tables) if numbers else _places(tables)
        if not places:
            return "nothing"
        place = chance.choice(places)
        holder = _holder(tables, place)
        holder[place[-1]] = make(chance, holder[place[-1]])
        return f"{'.'.join(map(str, place))} = {str(holder[place[-1]])[:60]}"

    return change


def _removed(chance: random.Random, tables: Table) -> str:
    place = chance.choice(_places(tables) or [("extends",)])
    holder = _holder(tables, place)
    if isinstance(holder, list):
        del holder[int(place[-1])]
    else:
        holder.pop(place[-1], None)
    return f"without {'.'.join(map(str, place))}"


def _renamed(chance: random.Random, tables: Table) -> str:
    places = [p for p in _places(tables) if isinstance(_holder(tables, p), dict)]
    if not places:
        return "nothing"
    place = chance.choice(places)
    holder, old = _holder(tables, place), str(place[-1])
    at = chance.randrange(len(old))
    new = chance.choice(
        (old[:at] + old[at + 1 :], old + "x", old.upper(), old * 400, "", "a.b", "\n", "é" + old)
    )
    holder[new] = holder.pop(old)
    return f"{'.'.join(map(str, place))} is {new[:30]!r}"


def _swapped(chance: random.Random, tables: Table) -> str:
    places = [p for p in _places(tables) if isinstance(_holder(tables, p)[p[-1]], dict)]
    pair = chance.sample(places, 2) if len(places) > 1 else []
    if not pair or pair[0] == pair[1][: len(pair[0])] or pair[1] == pair[0][: len(pair[1])]:
        return "nothing"
    (a, b), (one, other) = pair, (_holder(tables, p) for p in pair)
    one[a[-1]], other[b[-1]] = other[b[-1]], one[a[-1]]
    return f"{'.'.join(map(str, a))} and {'.'.join(map(str, b))} swapped"


def _nested(chance: random.Random, value: object) -> object:
    made: Any = value
    for _ in range(chance.choice((1, 3, 30, 150))):
        made = [made] if chance.random() < 0.5 else {chance.choice(("kind", "x", "a")): made}
    return made


_OTHER = (
    *(True, False, 0, 1, -1, 7, 1.5, "", "none", "left", "x", "1.0", [], [1], ["left"], [[0.0]]),
    *({}, {"kind": "none"}, {"kind": 3}, {"a": {"b": 1}}, "fig8", "../x", "\0", "\x1b[31m", "é"),
)
_EXTREME = (
    *(float("nan"), float("inf"), float("-inf"), 1e300, -1e300, 1e-320, 1e15, 1e9, 1e-15, 2**63),
    *(2**64, -(2**63), 10**30, 10**4000, 0, 0.0, -0.0),
)
_LONG = ("a" * 100_000, "\n" * 1000, "é" * 5000, [0.0] * 20_000, ["left"] * 5000)


def _extended(chance: random.Random, tables: Table) -> str:
    tables["extends"] = chance.choice(
        ("case.toml", "fig8", "fig88", "..", ".", "/dev/zero", "/dev/stdin", "/proc/self/mem",
         "none.toml", "", "x" * 5000, 5, ["fig8"], "\0", "/tmp/.toml", "~/x.toml")
    )  # fmt: skip
    return f"extends {str(tables['extends'])[:30]!r}"


_CHANGES: tuple[Callable[[random.Random, Table], str], ...] = (
    _set(lambda chance, _: chance.choice(_OTHER)),
    _set(lambda chance, _: chance.choice(_EXTREME)),
    _set(lambda chance, _: chance.choice(_EXTREME), numbers=True),
    _set(lambda _, value: -value, numbers=True),
    _set(lambda chance, value: value * 10.0 ** chance.uniform(-6, 6), numbers=True),
    # These are often accepted, and then run.
    *3 * (_set(lambda chance, value: value * chance.uniform(0.5, 2.0), numbers=True),),
    _set(lambda chance, value: type(value)(value * chance.choice((2, 3, 0.5))), numbers=True),
    _set(lambda chance, _: chance.choice(_LONG)),
    _set(_nested),
    _removed,
    _renamed,
    _swapped,
    _extended,
)


_SWEEPS: tuple[Table, ...] = (
    {
        **{"scenario": "fig8", "name": "gains", "metrics": ["peak_moment"]},
        **{"set": {"path": {"end_rad": 0.05}}, "sample": {"kind": "grid"}},
        "keys": {
            "sheet": {"width_m": {"values": [0.05, 0.06]}},
            "compliance.x.b": {"min": 10, "max": 100, "steps": 3, "log": True},
        },
    },
    {
        "scenario": "fig8",
        "sample": {"kind": "sobol", "n": 8, "sensitivity": True, "seed": 3, "noise": "each"},
        "keys": {
            "sheet.thickness_m": {"distribution": "uniform", "min": 4e-4, "max": 5e-4},
            "sheet.young_pa": {
                **{"distribution": "normal", "mean": 70e9, "std": 1e9, "min": 6e10, "max": 8e10}
            },
        },
    },
    {
        **{"scenario": "pwb", "sample": {"kind": "random", "n": 5}},
        "keys": {
            "task.errors.pickup_x_m": {"distribution": "loguniform", "min": 1e-4, "max": 1e-3},
            "robot.alter.delay_cycles": {"values": [1, 2]},
        },
    },
    {
        **{"scenario": "fig8", "sample": {"kind": "list"}},
        "keys": {"compliance": {"values": ["none", "admittance"]}, "seed": {"values": [1, 2]}},
    },
)


def _garbage(chance: random.Random, text: str) -> bytes:
    content = bytearray(text.encode("utf-8", "replace"))
    for _ in range(chance.choice((1, 1, 3, 20))):
        content[chance.randrange(len(content) + 1) : 0] = chance.randbytes(chance.choice((1, 1, 8)))
    return bytes(content)


def _cut(chance: random.Random, text: str) -> bytes:
    content = text.encode("utf-8", "replace")
    return content[: chance.randrange(len(content) + 1)]


def _doubled(chance: random.Random, text: str) -> bytes:
    lines = text.splitlines(keepends=True)
    at = chance.randrange(len(lines) + 1)
    return "".join(lines[: at + 1] + lines[max(at - 1, 0) :]).encode("utf-8", "replace")


_FILES: dict[str, Callable[[random.Random, str], bytes]] = {
    "byte order mark": lambda _, text: text.encode("utf-8-sig", "replace"),
    "UTF-16": lambda _, text: text.encode("utf-16", "replace"),
    "UTF-16 without mark": lambda _, text: text.encode("utf-16-le", "replace"),
    "Latin-1": lambda _, text: f"# é\n{text}".encode("latin-1", "replace"),
    "Mac's line ends": lambda _, text: text.replace("\n", "\r").encode("utf-8", "replace"),
    "DOS's line ends": lambda _, text: text.replace("\n", "\r\n").encode("utf-8", "replace"),
    "garbage": _garbage,
    "cut off": _cut,
    "lines twice": _doubled,
    "deep": lambda _, text: f"{text}\n[{'.'.join('a' * 3000)}]\n".encode("utf-8", "replace"),
    "deep list": lambda _, text: f"z = {'[' * 3000}{']' * 3000}\n{text}".encode("utf-8", "replace"),
    "hexadecimal": lambda _, text: f"z = 0x{'f' * 9000}\n{text}".encode("utf-8", "replace"),
    "empty": lambda *_: b"",
    "NUL": lambda _, text: text.encode("utf-8", "replace") + b"\0",
    "JSON": lambda *_: b'{"extends": "fig8"}',
}
