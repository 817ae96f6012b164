"""The public names: one list, one table of homes, one page, and nothing else in what users read."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import dualbend

DOCS = Path(__file__).parents[1] / "docs"
READ_BY_USERS = sorted(
    [*DOCS.glob("*.md"), *(DOCS / "examples").glob("*.py"), *(DOCS / "examples").glob("*.ipynb")]
)


def test_every_public_name_is_found_in_its_home() -> None:
    assert sorted(dualbend.__all__) == sorted(dualbend._HOMES)
    for name in dualbend.__all__:
        found = getattr(dualbend, name)
        assert getattr(found, "__name__", name).endswith(name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        dualbend.nothing  # noqa: B018


def test_type_checkers_see_the_same_names_in_the_same_homes() -> None:
    tree = ast.parse(Path(dualbend.__file__).read_text(encoding="utf-8"))
    seen = {
        alias.name: f"{node.module}.{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("dualbend")
        for alias in node.names
    }
    homes = {
        name: f"dualbend.{home}" if home.endswith(f".{name}") else f"dualbend.{home}.{name}"
        for name, home in dualbend._HOMES.items()
    }
    assert seen == homes


def test_the_page_has_a_line_for_every_public_name() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == sorted(dualbend.__all__)


def code_of(path: Path) -> Iterator[str]:
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        yield from ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
        return
    yield from [text] if path.suffix == ".py" else re.findall(r"```python\n(.*?)```", text, re.S)


@pytest.mark.parametrize("path", READ_BY_USERS, ids=lambda path: path.name)
def test_pages_and_examples_import_public_names_only(path: Path) -> None:
    for code in code_of(path):
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("dualbend"):
                assert node.module == "dualbend"
                assert {alias.name for alias in node.names} <= set(dualbend.__all__)
            elif isinstance(node, ast.Import):
                assert not any(alias.name.startswith("dualbend.") for alias in node.names)
