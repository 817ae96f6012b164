"""Write the table of the packages into CONTRIBUTING.md: purpose, lines, imports.

Run: ``python docs/house.py``. A test compares the table with the source, but for the lines.
"""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "dualbend"
PAGE = ROOT / "CONTRIBUTING.md"
BETWEEN = re.compile(r"(?<=<!-- house -->\n).*?(?=<!-- end -->)", re.DOTALL)


def units() -> dict[str, list[Path]]:
    """Return the modules of every package and every single module of the top level."""
    found: dict[str, list[Path]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.parent == PACKAGE and path.stem == "__init__":
            continue
        found.setdefault(path.relative_to(PACKAGE).parts[0].removesuffix(".py"), []).append(path)
    return found


def imports(paths: list[Path], names: set[str]) -> set[str]:
    """Return the packages that the modules import, also inside functions."""
    found = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("dualbend"):
                parts = f"{node.module}.{node.names[0].name}".split(".")
                found.add(parts[1])
    return found & names


def ordered(graph: dict[str, set[str]]) -> list[str]:
    """Return the packages from the ground up: each after those that it imports."""
    left, done = dict(graph), list[str]()
    while left:
        done.append(min(left, key=lambda name: (len(left[name] - set(done)), name)))
        del left[done[-1]]
    return done


def purpose(name: str, paths: list[Path]) -> str:
    """Return the first line of the package's docstring."""
    source = next((path for path in paths if path.stem == "__init__"), paths[0])
    text = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8")))
    assert text, f"{name} has no docstring"
    return text.splitlines()[0]


def table() -> str:
    """Return the table as Markdown."""
    found = units()
    graph = {name: imports(paths, set(found)) - {name} for name, paths in found.items()}
    rows = ["| package | what it is for | lines | imports |", "|---|---|---|---|"]
    order = ordered(graph)
    for name in order:
        lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in found[name])
        below = ", ".join(sorted(graph[name], key=order.index)) or "-"
        rows.append(f"| `{name}` | {purpose(name, found[name])} | {lines} | {below} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(
        BETWEEN.sub(lambda _: table(), PAGE.read_text(encoding="utf-8")), encoding="utf-8"
    )
