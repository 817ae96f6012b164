"""Small faults that are put into a source file, one at a time: where they are and how they are put.

The operators are those of cosmic-ray, of which the constants are harder: an integer changes by one,
a float is doubled. Not mutated: strings, annotations, decorators, keywords of a class, ``__all__``,
the arguments of ``raise``, of a warning and of ``said``, ``strict=`` of ``zip``.
"""

from __future__ import annotations

import ast
import copy
import hashlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

SWAPS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Div,),
    ast.Mod: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}
"""What takes the place of an operator."""

DECLARED = {"returns", "annotation", "decorator_list"}
SILENT_CALLS = {"said", "warn", "TypeVar", "ParamSpec", "NewType"}
Put = Callable[[ast.AST], None]


@dataclass(frozen=True)
class Mutant:
    """One fault: ``key`` tells it apart from all others and survives edits of other functions."""

    module: str
    key: str
    line: int
    first: int
    last: int
    function: str
    operator: str
    before: str
    after: str

    def rank(self, seed: int) -> str:
        """Return what mutants are sorted by for a draw."""
        return hashlib.sha256(f"{seed} {self.key}".encode()).hexdigest()


@dataclass(frozen=True)
class _Place:
    """Where the walk is: the names around it, the outermost function and the statement's lines."""

    names: tuple[str, ...] = ()
    function: str = ""
    statement: ast.stmt | None = None
    loop: bool = False


Found = tuple[_Place, ast.AST, str, ast.AST, Callable[[], None]]


def mutants(module: str, path: Path) -> list[Mutant]:
    """Return every mutant of a file, in the order of its text."""
    seen: Counter[str] = Counter()
    found = []
    for place, node, operator, new, _ in _sites(ast.parse(path.read_text(encoding="utf-8"))):
        before, after = _text(node), _text(new)
        text = f"{module} {'.'.join(place.names)} {operator}: {before} -> {after}"
        seen[text] += 1
        first, last = _lines(place.statement or node)
        line = getattr(node, "lineno", first)
        key = f"{text} #{seen[text]}"
        found.append(
            Mutant(module, key, line, first, last, place.function, operator, before, after)
        )
    return found


def mutated(path: Path, number: int) -> ast.Module:
    """Return the tree of a file with its mutant of this number in it."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    put = next(site[-1] for i, site in enumerate(_sites(tree)) if i == number)
    put()
    return tree


def _text(node: ast.AST) -> str:
    """Return a node in one line, of a compound statement what it decides by."""
    if isinstance(node, (ast.If, ast.IfExp, ast.While)):
        node = node.test
    elif isinstance(node, ast.For):
        node = node.iter
    return " ".join(ast.unparse(node).split())


def _lines(statement: ast.AST) -> tuple[int, int]:
    """Return the lines of a statement, of a compound one those of its head."""
    first: int = statement.lineno
    body = getattr(statement, "body", None)
    if isinstance(body, list):
        return first, max(first, body[0].lineno - 1)
    return first, statement.end_lineno or first


def _sites(tree: ast.Module) -> list[Found]:
    return list(_walk(tree, lambda _: None, _Place()))


def _walk(node: ast.AST, put: Put, place: _Place) -> Iterator[Found]:
    """Yield all mutants below a node that ``put`` replaces: the old one, the new one and how."""
    if _silent(node):
        return
    if isinstance(node, ast.stmt):
        place = _Place(place.names, place.function, node, place.loop)
    for operator, new in _replacements(node, place):
        yield place, node, operator, new, partial(put, _at(new, node))
    inner = _inside(node, place)
    for field, value in ast.iter_fields(node):
        if field in DECLARED or (field == "keywords" and isinstance(node, ast.ClassDef)):
            continue
        if isinstance(node, ast.Raise):
            continue
        around = inner if field == "body" else place
        if isinstance(value, ast.AST):
            yield from _walk(value, partial(setattr, node, field), around)
        elif isinstance(value, list):
            for i, item in enumerate(value):
                if isinstance(item, ast.AST):
                    yield from _walk(item, partial(value.__setitem__, i), around)


def _at(new: ast.AST, old: ast.AST) -> ast.AST:
    return ast.fix_missing_locations(ast.copy_location(new, old))


def _inside(node: ast.AST, place: _Place) -> _Place:
    """Return the place of a node's body."""
    loop = place.loop or isinstance(node, (ast.For, ast.While))
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        names = (*place.names, node.name)
        outermost = isinstance(node, ast.FunctionDef) and not place.function
        function = ".".join(names) if outermost else place.function
        return _Place(names, function, place.statement)
    return _Place(place.names, place.function, place.statement, loop)


def _silent(node: ast.AST) -> bool:
    """Tell whether nothing below a node is mutated: names of types, messages, `__all__`."""
    match node:
        case (
            ast.AnnAssign(annotation=ast.Name(id="TypeAlias"))
            | ast.Assign(targets=[ast.Name(id="__all__")])
            | ast.Subscript(value=ast.Name(id="Annotated" | "Literal"))
            | ast.keyword(arg="strict")
            | ast.If(test=ast.Name(id="TYPE_CHECKING"))
        ):
            return True
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in SILENT_CALLS
    return False


def _replacements(node: ast.AST, place: _Place) -> Iterator[tuple[str, ast.AST]]:
    """Yield the name of an operator and what it makes of a node."""
    match node:
        case ast.Compare():
            for i, old in enumerate(node.ops):
                for swap in SWAPS[type(old)]:
                    new = copy.deepcopy(node)
                    new.ops[i] = swap()  # type: ignore[call-overload]
                    yield "comparison", new
        case ast.BinOp() | ast.BoolOp() | ast.AugAssign():
            for swap in SWAPS.get(type(node.op), ()):
                new = copy.deepcopy(node)
                new.op = swap()  # type: ignore[assignment]
                yield "arithmetic" if not isinstance(node, ast.BoolOp) else "boolean", new
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield "unary", node.operand
        case ast.Attribute(attr="T", value=value):
            yield "transpose", value
        case ast.Constant():
            for value in _other_values(node.value):
                yield "constant", ast.Constant(value)
    yield from _condition(node)
    yield from _statement(node, place)


def _other_values(value: object) -> tuple[object, ...]:
    if isinstance(value, bool):
        return (not value,)
    if isinstance(value, int):
        return value + 1, value - 1
    if isinstance(value, float):
        return (2.0 * value if value else 1.0,)
    return ()


def _condition(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Negate a condition that no other operator reaches."""
    if isinstance(node, (ast.If, ast.IfExp, ast.While)) and not isinstance(
        node.test, (ast.Compare, ast.BoolOp, ast.UnaryOp, ast.Constant)
    ):
        new = copy.copy(node)
        new.test = ast.UnaryOp(ast.Not(), node.test)
        yield "condition", new


def _statement(node: ast.AST, place: _Place) -> Iterator[tuple[str, ast.AST]]:
    """Drop a statement, return nothing, leave a loop or pass over it."""
    match node:
        case ast.Break() if place.loop:
            yield "loop", ast.Continue()
        case ast.Continue() if place.loop:
            yield "loop", ast.Break()
        case ast.For():
            new = copy.copy(node)
            new.iter = ast.Tuple([], ast.Load())
            yield "loop", new
        case ast.Return(value=value) if value is not None and not _is_none(value):
            yield "return", ast.Return(ast.Constant(None))
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Raise():
            yield "statement", ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
            yield "statement", ast.Pass()


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None
