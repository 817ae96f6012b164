"""What a configuration struct holds: keys, kinds, types, as ``msgspec`` has them.

Loading, messages, schema, reference and template walk a scenario's structs by this. A section of
several kinds is a union of :class:`~dualbend.types.Tagged` structs; the first of them is the kind
of a section that does not say its own.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import msgspec
from msgspec import inspect as mi

from dualbend.scenario.task import AnyTask, TaskKinds

Struct: TypeAlias = type[msgspec.Struct]
Kinds: TypeAlias = Mapping[str, Struct]
"""The structs that a table may be, by kind; one without kinds by "", none of a value."""

KIND = "kind"
"""The key that says of which kind a section is."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """One key of a struct.

    Attributes
    ----------
    annotation, type : as written; as ``msgspec.inspect`` has it, without None and what is said
    default : msgspec.NODEFAULT where there is none
    said : of the key, for a JSON schema
    replaces : keys beside it that it takes back; None of a key that does not work so
    kinds : of the tables that it holds
    many : it holds a list
    """

    name: str
    annotation: Any
    type: mi.Type
    default: Any
    said: Mapping[str, Any]
    replaces: tuple[str, ...] | None
    kinds: Kinds
    many: bool

    @property
    def is_section(self) -> bool:
        """It holds a table."""
        return bool(self.kinds) and not self.many


@functools.cache
def fields_of(struct: Struct) -> dict[str, Field]:
    """Return a struct's fields by key; the kind of a section is none of them."""
    return {field.encode_name: _field(field) for field in msgspec.structs.fields(struct)}


def _field(field: msgspec.structs.FieldInfo) -> Field:
    info, said, extra = plain(mi.type_info(field.type))
    made = field.default_factory is not msgspec.NODEFAULT
    return Field(
        name=field.encode_name,
        annotation=field.type,
        type=info,
        default=field.default_factory() if made else field.default,
        said=said,
        replaces=extra.get("replaces"),
        kinds=_kinds(info.item_type if isinstance(info, mi.VarTupleType) else info),
        many=isinstance(info, mi.VarTupleType),
    )


def plain(info: mi.Type) -> tuple[mi.Type, dict[str, Any], dict[str, Any]]:
    """Return a type without None and without what is said of it, that, and what is noted."""
    if isinstance(info, mi.UnionType):
        options = [option for option in info.types if not isinstance(option, mi.NoneType)]
        if len(options) == 1:
            return plain(options[0])
    if isinstance(info, mi.Metadata):
        inner, said, extra = plain(info.type)
        return inner, {**said, **(info.extra_json_schema or {})}, {**extra, **(info.extra or {})}
    return info, {}, {}


def _kinds(info: mi.Type) -> Kinds:
    if isinstance(info, mi.CustomType) and info.cls is AnyTask:
        return TaskKinds()
    options = info.types if isinstance(info, mi.UnionType) else (info,)
    return {str(o.tag or ""): o.cls for o in options if isinstance(o, mi.StructType)}


def has_kinds(kinds: Kinds) -> bool:
    """Tell a section of several kinds from one of a single kind, and from a value."""
    return bool(kinds) and "" not in kinds


def fields_in(kinds: Kinds, table: object) -> dict[str, Field]:
    """Return the fields of the kind that a table is of, of all kinds where it does not say."""
    kind = table.get(KIND) if isinstance(table, dict) and has_kinds(kinds) else None
    found: dict[str, Field] = {}
    for name, struct in kinds.items():
        if name == kind or not isinstance(kind, str):
            found = {**fields_of(struct), **found}
    return found
