"""The import direction and the homes of the libraries, read from the source with ``ast``."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import dualbend

PACKAGE = Path(dualbend.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
ROOMS = ("beam", "control", "scene", "task", "run", "analysis", "cli")
"""Each imports only from those before it; errors and resources are below all of them."""
FOUNDATION = {"__init__", "errors", "resources"}
HOMES = {
    "mink": "scene/ik.py",
    "rerun": "run/recording",  # one home of several rooms: recording.py, recording_*.py
    "matplotlib": "analysis/figures",
    "mpl_toolkits": "analysis/figures",
    "bokeh": "analysis/report_plots.py",
    "contourpy": "analysis/report_plots.py",
}
NO_MUJOCO = ("beam", "control")


def imported(path: Path) -> Iterator[tuple[str, int]]:
    """Yield every module that a file imports, inside functions too, with its line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            assert node.module is not None
            # "from dualbend.scene import arm" names the module dualbend.scene.arm.
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def room(parts: tuple[str, ...]) -> str:
    return parts[0].removesuffix(".py") if parts else "__init__"


def where(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


@pytest.mark.parametrize("path", MODULES, ids=where)
def test_a_module_imports_only_what_is_below_it(path: Path) -> None:
    own = room(path.relative_to(PACKAGE).parts)
    if where(path) == "__init__.py":  # the face, above every room
        return
    assert own in FOUNDATION or own in ROOMS, f"{where(path)}: a room that the order does not know"
    allowed = FOUNDATION if own in FOUNDATION else FOUNDATION | {*ROOMS[: ROOMS.index(own) + 1]}
    for name, line in imported(path):
        if name.split(".")[0] == "dualbend":
            assert name.removeprefix("dualbend.") not in dualbend.__all__, (
                f"{where(path)}:{line}: {name} is the public face, above {own}"
            )
            target = room(tuple(name.split(".")[1:]))
            is_room = target in ROOMS or target in FOUNDATION
            assert not is_room or target in allowed, (
                f"{where(path)}:{line}: {own} must not import {name}"
            )


@pytest.mark.parametrize("library", HOMES)
def test_a_library_has_one_home(library: str) -> None:
    users = {
        where(path)
        for path in MODULES
        if any(name.split(".")[0] == library for name, _ in imported(path))
    }
    strangers = {user for user in users if not user.startswith(HOMES[library])}
    assert not strangers, f"{library} is imported outside its home: {strangers}"


@pytest.mark.parametrize("name", NO_MUJOCO)
def test_the_mathematics_never_imports_mujoco(name: str) -> None:
    paths = sorted((PACKAGE / name).glob("*.py"))
    assert len(paths) > 5  # a renamed folder must not make this test empty
    for path in paths:
        assert "mujoco" not in {module.split(".")[0] for module, _ in imported(path)}, where(path)


def test_only_the_simulation_steps_the_physics() -> None:
    steppers = {
        where(path)
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if (isinstance(node, ast.Attribute) and node.attr.startswith("mj_step"))
        or (isinstance(node, ast.alias) and node.name.startswith("mj_step"))
        or (isinstance(node, ast.Name) and node.id.startswith("mj_step"))
    }
    assert "scene/simulation.py" in steppers
    # Validation builds scenes of its own; the benchmark's yardstick is the bare step.
    allowed = ("scene/simulation.py", "analysis/validation", "analysis/benchmark.py")
    assert {s for s in steppers if not s.startswith(allowed)} == set()


def test_lazy_libraries_are_not_loaded_by_the_loop() -> None:
    """Importing the loop must not cost the import of the viewer and the plots."""
    import subprocess
    import sys

    code = (
        "import sys, dualbend.run.runner; "
        "print([m for m in ('rerun', 'matplotlib', 'bokeh') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
