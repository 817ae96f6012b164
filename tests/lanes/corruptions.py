"""Ways to corrupt a file, each seeded: bytes, JSON, TOML, a table of Arrow, the file itself."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

Way = Callable[[Path, random.Random], str]
"""Corrupts a file and returns what it did; "" where that file cannot be corrupted so."""

STRANGE: tuple[Any, ...] = (
    *(None, True, -1, 0, 99, 0.5, 1e300, 10**30, 10**400, "", "text", "é\u2028", "x" * 100_000),
    *([], [None], [1.0, "a"], {}, {"a": {"b": 1}}),
)


# -- any file ------------------------------------------------------------------------------------


def truncated(path: Path, rng: random.Random) -> str:
    size = path.stat().st_size
    at = rng.randrange(size)
    os.truncate(path, at)
    return f"cut at byte {at} of {size}"


def flipped(path: Path, rng: random.Random) -> str:
    data = bytearray(path.read_bytes())
    places = [rng.randrange(len(data)) for _ in range(rng.choice((1, 1, 1, 20)))]
    for at in places:
        data[at] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    return f"{len(places)} bits flipped, the first in byte {places[0]}"


def zeroed(path: Path, rng: random.Random) -> str:
    data = bytearray(path.read_bytes())
    at = rng.randrange(len(data))
    data[at : at + 512] = bytes(len(data[at : at + 512]))
    path.write_bytes(data)
    return f"a block of zeros at byte {at}"


def garbled(path: Path, rng: random.Random) -> str:
    path.write_bytes(rng.randbytes(rng.choice((1, 100, 5000))))
    return "random bytes"


def emptied(path: Path, _: random.Random) -> str:
    path.write_bytes(b"")
    return "empty"


def deleted(path: Path, _: random.Random) -> str:
    path.unlink()
    return "deleted"


def a_folder(path: Path, _: random.Random) -> str:
    path.unlink()
    path.mkdir()
    return "a folder"


def a_pipe(path: Path, _: random.Random) -> str:
    path.unlink()
    os.mkfifo(path)
    return "a pipe"


def a_circle(path: Path, _: random.Random) -> str:
    path.unlink()
    path.symlink_to(path.name)
    return "a link to itself"


def forbidden(path: Path, _: random.Random) -> str:
    path.chmod(0)
    return "" if os.access(path, os.R_OK) else "not readable"


ANY: tuple[Way, ...] = (
    *(truncated, flipped, flipped, zeroed, garbled, emptied, deleted),
    *(a_folder, a_pipe, a_circle, forbidden),
)


# -- JSON ----------------------------------------------------------------------------------------


def _places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths to all values of a tree."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    found = [] if not at else [at]
    if isinstance(value, dict | list):
        for key, item in items:
            found += _places(item, (*at, key)) if isinstance(item, dict | list) else [(*at, key)]
    return found


def _change(tree: Any, rng: random.Random, change: Callable[[Any, Any], str]) -> str:
    """Change a value somewhere in a tree: ``change`` gets what holds it and its key."""
    places = _places(tree)
    # As often of the top as of the many below.
    depth = rng.choice(sorted({len(place) for place in places}))
    *way, key = rng.choice([place for place in places if len(place) == depth])
    holder = tree
    for part in way:
        holder = holder[part]
    return f"{'.'.join(map(str, (*way, key)))}: {change(holder, key)}"


def _retyped(holder: Any, key: Any, rng: random.Random) -> str:
    value = rng.choice([v for v in STRANGE if v != holder[key] or type(v) is not type(holder[key])])
    holder[key] = value
    return f"is {str(value)[:30]!r}"


def _moved(holder: Any, key: Any, rng: random.Random) -> str:
    value = holder[key]
    if isinstance(value, bool):
        holder[key] = not value
    elif isinstance(value, int | float):
        holder[key] = rng.choice((-value, value + 1, 2 * value, value * (1 + 1e-9))) or 1
    elif isinstance(value, str):
        holder[key] = rng.choice((value + "x", value[1:], value.upper() + "?"))
    else:
        holder[key] = type(value)()
    return f"{str(value)[:30]!r} is {str(holder[key])[:30]!r}"


def _gone(holder: Any, key: Any) -> str:
    del holder[key]
    return "gone"


def _line_of(path: Path, rng: random.Random) -> tuple[list[str], int]:
    """Return the JSON texts of a file, one or one a line, and which one is changed."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".jsonl":
        return [text], 0
    lines = text.splitlines()
    return lines, rng.randrange(len(lines))


def _json(change: Callable[[Any, Any, random.Random], str]) -> Way:
    def corrupt(path: Path, rng: random.Random) -> str:
        texts, at = _line_of(path, rng)
        tree = json.loads(texts[at])
        said = _change(tree, rng, lambda holder, key: change(holder, key, rng))
        texts[at] = json.dumps(tree, indent=None if path.suffix == ".jsonl" else 2)
        path.write_text("\n".join(texts) + "\n", encoding="utf-8")
        return said

    corrupt.__name__ = f"value {change.__name__.strip('_')}"
    return corrupt


def key_twice(path: Path, rng: random.Random) -> str:
    texts, at = _line_of(path, rng)
    keys = list(re.finditer(r'"(\w+)": ?(?=[\d"tfn])', texts[at]))
    chosen = rng.choice(keys)
    texts[at] = f"{texts[at][: chosen.start()]}{chosen[0]}1, {texts[at][chosen.start() :]}"
    path.write_text("\n".join(texts) + "\n", encoding="utf-8")
    return f"key {chosen[1]} twice"


def not_a_number(path: Path, rng: random.Random) -> str:
    texts, at = _line_of(path, rng)
    chosen = rng.choice(list(re.finditer(r"(?<=: )-?\d[\d.e+-]*|(?<=:)-?\d[\d.e+-]*", texts[at])))
    value = rng.choice(("NaN", "Infinity", "-Infinity", "1e999", "-1e400", "1" + 400 * "0"))
    texts[at] = texts[at][: chosen.start()] + value + texts[at][chosen.end() :]
    path.write_text("\n".join(texts) + "\n", encoding="utf-8")
    return f"{value[:10]} for {chosen[0]}"


def nested(path: Path, rng: random.Random) -> str:
    texts, at = _line_of(path, rng)
    texts[at] = 5000 * '{"a":' + "1" + 5000 * "}"
    path.write_text("\n".join(texts) + "\n", encoding="utf-8")
    return "nested 5000 deep"


def line_twice(path: Path, rng: random.Random) -> str:
    texts, at = _line_of(path, rng)
    if path.suffix != ".jsonl":
        return ""
    path.write_text("\n".join([*texts, texts[at]]) + "\n", encoding="utf-8")
    return f"line {at + 1} twice"


JSON: tuple[Way, ...] = (
    *(_json(_retyped), _json(_retyped), _json(_retyped), _json(_moved), _json(_moved)),
    *(_json(lambda holder, key, _: _gone(holder, key)), key_twice, not_a_number, nested),
    line_twice,
)


# -- TOML ----------------------------------------------------------------------------------------


def line_gone(path: Path, rng: random.Random) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    at = rng.choice([i for i, line in enumerate(lines) if line.strip()])
    said = lines.pop(at)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"without {said!r}"


def number_changed(path: Path, rng: random.Random) -> str:
    text = path.read_text(encoding="utf-8")
    found = list(re.finditer(r"(?<== )-?\d[\d.e+-]*", text))
    at = rng.choice(found)
    value = rng.choice(("0", "-1", "1e300", "nan", "inf", "true", '"x"', "[]", "7", at[0] + "1"))
    path.write_text(text[: at.start()] + value + text[at.end() :], encoding="utf-8")
    return f"{value} for {at[0]}"


def line_added(path: Path, rng: random.Random) -> str:
    line = rng.choice(("strange = 1", "name = 'x'", "[sheet]", "= =", "[task]\nkind = 'assembly'"))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n{line}\n", encoding="utf-8")
    return f"with {line!r}"


def another_encoding(path: Path, _: random.Random) -> str:
    path.write_bytes(b"\xff\xfe" + path.read_bytes())
    return "with bytes that are no UTF-8"


TOML: tuple[Way, ...] = (line_gone, number_changed, number_changed, line_added, another_encoding)


# -- a table of Arrow ----------------------------------------------------------------------------


def _table(change: Callable[[pa.Table, random.Random], tuple[pa.Table, str]]) -> Way:
    def corrupt(path: Path, rng: random.Random) -> str:
        if path.suffix == ".parquet":
            table, said = change(pq.read_table(path), rng)
            pq.write_table(table, path)
            return said
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            found = stream.read_all()
        table, said = change(found, rng)
        with path.open("wb") as file, pa.ipc.new_stream(file, table.schema) as writer:
            writer.write_table(table)
        return said

    corrupt.__name__ = change.__name__
    return corrupt


def _any(table: pa.Table, rng: random.Random) -> int:
    """Return a column; as often one that every reader needs as any other."""
    names = ("time", "phase", "nominal_alpha", "bend_000", "left_true_moment_y", "wall_s")
    return table.column_names.index(rng.choice((rng.choice(names), rng.choice(table.column_names))))


def _values(table: pa.Table, at: int, values: Any, kind: Any = None) -> pa.Table:
    field = table.schema.field(at)
    array = pa.array(values, kind or field.type)
    return table.set_column(at, pa.field(field.name, array.type, metadata=field.metadata), array)


def column_gone(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at = _any(table, rng)
    return table.remove_column(at), f"without column {table.column_names[at]}"


def column_renamed(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at, names = _any(table, rng), list(table.column_names)
    said, names[at] = names[at], rng.choice(("x", names[0], names[-1], names[at].upper()))
    return table.rename_columns(names), f"column {said} is {names[at]}"


def column_retyped(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at = _any(table, rng)
    kind = rng.choice((pa.string(), pa.int64(), pa.float32(), pa.bool_(), pa.list_(pa.float64())))
    values = np.nan_to_num(table.column(at).to_numpy())
    if pa.types.is_list(kind):
        made: Any = [[value] for value in values]
    elif pa.types.is_string(kind):
        made = [rng.choice((str(value), "text")) for value in values]
    else:
        made = values.astype(kind.to_pandas_dtype())
    return _values(table, at, made, kind), f"column {table.column_names[at]} of {kind}"


def column_added(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    name = rng.choice(("strange", "bend_999", "sheet", table.column_names[1]))
    return table.append_column(name, table.column(1)), f"a column {name} more"


def column_order(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    names = list(table.column_names)
    a, b = rng.sample(range(len(names)), 2)
    names[a], names[b] = names[b], names[a]
    return table.select(names), f"{names[a]} and {names[b]} in each other's place"


def unit_changed(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at = _any(table, rng)
    field = table.schema.field(at)
    unit = rng.choice(("mm", "", "deg"))
    field = field.with_metadata({"unit": unit})
    return table.set_column(at, field, table.column(at)), f"column {field.name} in {unit!r}"


def cell_changed(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at, row = _any(table, rng), rng.randrange(table.num_rows)
    values = table.column(at).to_pylist()
    strange = (None, np.nan, np.inf, -1.0, 99.0, 0.5, 1e6, 1e12, 1e300, values[row] + 1e-6)
    values[row] = rng.choice(strange)
    return _values(table, at, values), f"{table.column_names[at]}[{row}] is {values[row]}"


def column_filled(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    at, value = _any(table, rng), rng.choice((np.nan, 0.0, 1e9, -3.0, np.inf))
    name = table.column_names[at]
    return _values(table, at, np.full(table.num_rows, value)), f"column {name} all {value}"


def rows_changed(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    n, at = table.num_rows, rng.randrange(1, table.num_rows)
    ways = {
        "no rows": table.slice(0, 0),
        "one row": table.slice(0, 1),
        f"the first {at} rows": table.slice(0, at),
        f"the rows from {at} on": table.slice(at),
        "each row twice": table.take(np.repeat(np.arange(n), 2)),
        "rows backwards": table.take(np.arange(n)[::-1]),
        f"without row {at}": table.take(np.delete(np.arange(n), at)),
        "a thousand times as many": pa.concat_tables([table] * 1000),
    }
    said = rng.choice(list(ways))
    return ways[said], said


def metadata_changed(table: pa.Table, rng: random.Random) -> tuple[pa.Table, str]:
    about = json.loads(table.schema.metadata[b"dualbend"])
    key = rng.choice(list(about))
    said = rng.choice(("gone", "[]", '{"a": 1}', "text", "other", "dropped"))
    if said == "other":
        about[key] += "1"
    elif said == "dropped":
        del about[key]
    text = json.dumps(about) if said in ("other", "dropped") else said
    metadata = {} if said == "gone" else {"dualbend": text}
    return table.replace_schema_metadata(metadata), f"metadata {said}: {key}"


TABLE: tuple[Way, ...] = tuple(
    _table(change)
    for change in (
        *(column_gone, column_renamed, column_retyped, column_added, column_order, unit_changed),
        *(cell_changed, cell_changed, cell_changed, column_filled, rows_changed, rows_changed),
        metadata_changed,
    )
)

BY_ENDING: dict[str, tuple[Way, ...]] = {
    ".json": JSON,
    ".jsonl": JSON,
    ".toml": TOML,
    ".parquet": TABLE,
    ".arrow": TABLE,
}


def ways_for(path: Path) -> tuple[Way, ...]:
    """Return the ways to corrupt a file, those that know what it holds twice as often."""
    return (*ANY, *BY_ENDING[path.suffix], *BY_ENDING[path.suffix])


def swapped(path: Path, other: Path) -> str:
    """Put another run's file in the place of this one's."""
    if not other.is_file():
        return ""
    shutil.copyfile(other, path)
    return f"that of {other.parent.name}"
