"""The plan of the house, read from the source with ``ast``: order of the packages, sizes, homes."""

import ast
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

import dualbend
from support.scripts import load_script

PACKAGE = Path(dualbend.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
FOUNDATION = ("errors", "interrupts", "types", "resources", "registry", "table", "files")
ROOMS = (
    *FOUNDATION,
    "beam",
    "mechanics",
    "control",
    "arm",
    "imperfection",
    "scene",
    "planning",
    "scenario",
    "run",
    "evaluation",
    "stability",
    "recording",
    "logs",
    "report",
    "task",
    "batch",
    "env",
    "serve",
    "testing",
    "study",
    "check",
    "validation",
    "cli",
    "__main__",
)
"""Each imports only from those before it."""
HOMES = {
    "mink": "scene/ik.py",
    "rerun": ("recording/", "task/"),
    "matplotlib": "report/canvas.py",
    "bokeh": "report/bokeh.py",
    "contourpy": "report/stability_map.py",
    "jinja2": "report/template.py",
    "markdown_it": "report/template.py",
    "av": "recording/pictures/video.py",
    "mcap": "logs/",
    "trimesh": "arm/meshes.py",
    "warp": "batch/gpu/",
    "mujoco_warp": "batch/gpu/",
    "gymnasium": "env/",
    "pettingzoo": "env/",
}
NO_MUJOCO = ("beam", "control", "planning")
LARGEST_MODULE, MOST_MODULES, LARGEST_SHARE = 400, 15, 0.12
"""Lines of a module; modules of a folder; a package's share of all lines."""


def where(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def name_of(path: Path) -> str:
    """Return the dotted name below the package; a package's own is that of its folder."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path): path for path in MODULES}


def imported(path: Path) -> Iterator[tuple[str, int]]:
    """Yield every module that a file imports, inside functions too, with its line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            assert node.module is not None
            # "from dualbend.arm import model" names the module dualbend.arm.model.
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def own_imports(path: Path) -> Iterator[tuple[str, int]]:
    """Yield the modules of this package that a file imports, below the package."""
    for name, line in imported(path):
        if name.split(".")[0] == "dualbend":
            assert name.removeprefix("dualbend.") not in dualbend.__all__, (
                f"{where(path)}:{line}: {name} is the public face, above every room"
            )
            below = name.removeprefix("dualbend.")
            yield (below if below in NAMES else below.rpartition(".")[0]), line


INSIDE = [path for name, path in NAMES.items() if name]
"""All but the public face, which is above every room."""


@pytest.mark.parametrize("path", INSIDE, ids=where)
def test_a_module_imports_only_what_is_below_it(path: Path) -> None:
    own = name_of(path).split(".")[0]
    assert own in ROOMS, f"{where(path)}: a room that the order does not know"
    for name, line in own_imports(path):
        room = name.split(".")[0]
        assert ROOMS.index(room) <= ROOMS.index(own), (
            f"{where(path)}:{line}: {own} must not import {name}"
        )


FOLDERS = sorted({path.parent for path in MODULES})


@pytest.mark.parametrize("folder", FOLDERS, ids=where)
def test_imports_inside_a_folder_make_no_circle(folder: Path) -> None:
    """Its modules and its sub-folders, each taken as one, import each other one way."""
    prefix = name_of(folder / "__init__.py")
    prefix = f"{prefix}." if prefix else ""
    graph: dict[str, set[str]] = defaultdict(set)
    for name, path in NAMES.items():
        if not name or not name.startswith(prefix):
            continue
        unit = name.removeprefix(prefix).split(".")[0]
        for target, _ in own_imports(path):
            if target.startswith(prefix):
                graph[unit].add(target.removeprefix(prefix).split(".")[0])
    left = {unit: targets - {unit} for unit, targets in graph.items()}
    while free := [unit for unit, targets in left.items() if not targets & left.keys()]:
        for unit in free:
            del left[unit]
    assert not left, f"{where(folder)}: a circle among {sorted(left)}"


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
    paths = sorted((PACKAGE / name).rglob("*.py"))
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
    allowed = ("scene/simulation.py", "validation/", "study/benchmark.py")
    assert {s for s in steppers if not s.startswith(allowed)} == set()


def test_lazy_libraries_are_not_loaded_by_the_loop() -> None:
    """Importing the loop must not cost the import of the viewer and the plots."""
    code = (
        "import sys, dualbend.run.loop; "
        "print([m for m in ('rerun', 'matplotlib', 'bokeh') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_contributing_draws_the_packages_as_they_are() -> None:
    """All but the counts of lines, which change every day: ``python docs/house.py``."""
    house = load_script(Path(__file__).parents[1] / "docs" / "house.py")
    drawn = house.BETWEEN.search(house.PAGE.read_text(encoding="utf-8"))
    assert drawn is not None

    def without_lines(table: str) -> list[list[str]]:
        cells = [row.split(" | ") for row in table.splitlines()]
        return [[*row[:2], *row[3:]] for row in cells]

    assert without_lines(drawn[0]) == without_lines(house.table())


def test_folders_are_small_and_have_no_families_of_prefixes() -> None:
    modules = [path for path in MODULES if path.name != "__init__.py"]
    crowded = {
        where(folder): count
        for folder, count in Counter(path.parent for path in modules).items()
        if count > MOST_MODULES
    }
    assert not crowded
    prefixes = Counter(
        (where(path.parent), path.stem.split("_")[0])
        for path in modules
        if "_" in path.stem.strip("_")
    )
    assert not {key: count for key, count in prefixes.items() if count >= 3}


def lines(path: Path) -> int:
    return path.read_text(encoding="utf-8").count("\n")


def test_modules_and_rooms_are_of_a_size_that_is_read() -> None:
    assert not {where(path): lines(path) for path in MODULES if lines(path) > LARGEST_MODULE}
    total = sum(map(lines, MODULES))
    rooms = Counter[str]()
    for path in INSIDE:
        rooms[name_of(path).split(".")[0]] += lines(path)
    assert not {room: n for room, n in rooms.items() if n > LARGEST_SHARE * total}
