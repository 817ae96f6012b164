"""The documentation cannot rot: its examples run, its references exist, its site builds."""

import ast
import importlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from click.testing import CliRunner

import dualbend
from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.cli import main
from dualbend.scenario.load import Settings, load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.toml_text import toml
from dualbend.validation.page import validation_page
from dualbend.validation.row import of_property, relative
from icra1995 import beam as audit_beam

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
THEORY = sorted(DOCS.glob("theory-*.md"))
WITH_EXAMPLES = ("tutorial", "results", "api", "ci", "your-controller", "your-sheet")
SLOW_EXAMPLES = {"performance": 2, "environments": 3}
"""How many there are."""

SHORT = (
    "path.end_rad=0.4",
    "motion.speed_rad_per_s=1.0",
    "motion.settle_s=0.3",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
    "physics.step_s=0.0035",
)
"""What an example is shortened by: every statement runs, on a motion of half a second."""

_BLOCK = re.compile(
    r"<!-- (?P<kind>run|output)(?:: (?P<how>[^>]*?))? -->\n```(?:\w*)\n(?P<text>.*?)```", re.DOTALL
)


class Block(NamedTuple):
    """An example of a page: ``python``, ``shell``, ``file NAME`` or the ``output`` before it."""

    kind: str
    how: list[str]
    text: str


def blocks(page: Path) -> Iterator[Block]:
    for found in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        how = [part.strip() for part in (found["how"] or "").split(",")]
        yield Block(found["kind"], how, found["text"])


def shortened(line: str) -> list[str]:
    """Return the arguments of a ``dualbend`` line, a run's with a shorter motion."""
    arguments = shlex.split(line)[1:]
    if arguments[0] == "run":
        arguments += [part for setting in SHORT for part in ("--set", setting)]
    if arguments[0] in ("run", "compare"):
        arguments.append("--no-record")
    if arguments[0] == "check":
        arguments += ["--workers", "1"]
    return arguments


def run_shell(block: Block) -> None:
    wanted = next((int(h.removeprefix("exit ")) for h in block.how if h.startswith("exit")), 0)
    for line in block.text.splitlines():
        if not line.startswith("dualbend"):
            continue  # what the shell does itself: git, pip
        ended = CliRunner().invoke(main, shortened(line))
        assert ended.exit_code == wanted, f"{line}\n{ended.output}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [*WITH_EXAMPLES, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW_EXAMPLES)],
)
def test_every_example_runs(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    short = True

    def loaded(which: str, settings: Settings = (), seed: int | None = None) -> Scenario:
        if isinstance(settings, Mapping):
            settings = [f"{key}={toml(value)}" for key, value in settings.items()]
        return load_scenario(which, [*settings, *(SHORT if short else ())], seed)

    monkeypatch.setattr(dualbend, "load_scenario", loaded, raising=False)
    names: dict[str, object] = {"__name__": name}
    printed, ran = "", 0
    for block in blocks(DOCS / f"{name}.md"):
        how = block.how[0]
        if block.kind == "output":
            assert printed == block.text  # golden
            continue
        ran += 1
        if how.startswith("file "):
            shorter = ""
            if name == "ci":
                shorter = "[path]\nend_rad = 0.4\n[motion]\nspeed_rad_per_s = 1.0\nhold_s = 0.1\n"
            (tmp_path / how.removeprefix("file ")).write_text(block.text + shorter)
        elif how == "shell":
            run_shell(block)
        else:
            assert how == "python", block.how
            short = "whole" not in block.how
            capsys.readouterr()
            exec(compile(block.text, f"{name}.md", "exec"), names)
            printed = capsys.readouterr().out
    assert ran >= SLOW_EXAMPLES.get(name, 4)


def test_no_example_is_left_out() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        unmarked = text.count("```python") - len(
            re.findall(r"<!-- (?:run: (?:python|file)[^>]*|example: tested) -->\n```python", text)
        )
        assert unmarked == 0, f"{page.name}: a Python example without a mark is not run"


def test_every_command_is_on_the_page_of_the_commands() -> None:
    page = (DOCS / "command-line.md").read_text(encoding="utf-8")
    wanted = [
        f"| `dualbend {name}` | {command.get_short_help_str(limit=200)} |"
        for name, command in main.commands.items()
    ]
    told = re.findall(r"^\| `dualbend [\w-]+` \|.*\|$", page, re.MULTILINE)
    assert sorted(told) == sorted(wanted), "put these lines into the table of the commands"


# --- the theory ------------------------------------------------------------------------------


def theory() -> str:
    return "\n".join(page.read_text(encoding="utf-8") for page in THEORY)


def test_links_between_the_pages_lead_to_files() -> None:
    pages = [*ROOT.glob("*.md"), *PAGES]
    missing = [
        (page.name, link)
        for page in pages
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
        if "://" not in link and not (page.parent / link).exists()
    ]
    assert not missing


def test_equations_are_numbered_one_after_the_other() -> None:
    for page, letter in zip(THEORY, "ALS", strict=True):
        found = re.findall(r"\\tag\{(\w+)\}", page.read_text(encoding="utf-8"))
        assert found == [f"{letter}{i + 1}" for i in range(len(found))]


def test_every_equation_names_its_source_its_code_or_its_test() -> None:
    for page in THEORY:
        for part in page.read_text(encoding="utf-8").split("\\tag{")[1:]:
            words = re.sub(r"\$\$.*", "", part[part.index("$$") + 2 :], flags=re.DOTALL)
            # Two that belong together are named together, below the second.
            together = len(words) < 60
            assert together or ("*Source*" in words and re.search(r"\*(Code|Held by)\*", words)), (
                part
            )


def test_the_code_that_the_theory_names_exists() -> None:
    named = set(re.findall(r"`(dualbend\.[\w.]+)`", theory()))
    assert len(named) > 60
    for name in named:
        _resolve(name)


def _resolve(name: str) -> object:
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for attribute in parts[n:]:
            found = getattr(found, attribute)
        return found
    raise AssertionError(name)


def test_the_tests_that_the_theory_names_exist() -> None:
    named = set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", theory()))
    assert len(named) > 60
    for file, test in named:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test


def test_the_validation_rows_that_the_theory_names_exist() -> None:
    table = (DOCS / "validation.md").read_text(encoding="utf-8")
    named = re.findall(r'validation\s+"([^"]+)"', theory())
    assert len(named) > 5
    for row in named:
        assert re.sub(r"\s+", " ", row) in table


def test_the_statements_of_the_audit_that_the_theory_names_exist() -> None:
    audit = (DOCS / "audit.md").read_text(encoding="utf-8")
    statements = {int(n) for n in re.findall(r"^\| (\d+) \|", audit, re.MULTILINE)}
    groups = re.findall(r"audit (\d+(?:(?:,| and) \d+)*)", theory())
    named = {int(n) for group in groups for n in re.findall(r"\d+", group)}
    assert len(named) > 15
    assert named <= statements


@pytest.mark.parametrize(("piece", "excess"), [(1, 0.08), (2, 0.08), (3, 0.14), (4, 0.24)])
def test_the_estimate_of_the_chords_moment_is_as_good_as_the_page_says(
    piece: int, excess: float
) -> None:
    alpha = np.linspace(0.2 * piece, 0.2 * piece + 0.2, 2001)
    chord = (alpha - alpha[0]) * (alpha[-1] - alpha) / alpha
    estimate = np.pi**2 / 2.0 * chord.max()
    # Golden, to the digits of the page.
    assert estimate / audit_beam.piece_peak(0.2, piece) - 1.0 == pytest.approx(excess, abs=0.006)


def test_the_moment_per_distance_is_as_the_page_says() -> None:
    alpha = 0.05
    state = rod.solve_symmetric(1.0, 1.0, alpha, elastica.half_distance(alpha, 1.0))
    found = state.symmetric_stiffness().moment_per_distance_n
    # Analytic, first order in α².
    assert found == pytest.approx(-4.0 * np.pi**2 / alpha, rel=2e-3)


# --- the pages that are made ------------------------------------------------------------------


def test_the_validation_page_says_what_the_rows_say() -> None:
    rows = [
        relative("right", 1.001, 1.0, "N", 0.01),
        of_property(relative("wr|ong", 2.0, 1.0, "1", 0.01)),
    ]
    page = validation_page(rows, {"mujoco": "4.0.0"})
    assert "1 of 2 rows pass" in page
    assert "mujoco 4.0.0" in page
    assert "| pass | mechanics | right (relative) | 1.001 | 1 | N | 0.001 | 0.01 |" in page
    assert "| **FAIL** | property | wr\\|ong (relative) | 2 | 1 |  | 1 | 0.01 |" in page
    assert page == validation_page(rows, {"mujoco": "4.0.0"})


def test_a_page_that_cannot_be_written_is_refused_before_anything_is_measured() -> None:
    ended = CliRunner().invoke(main, ["validate", "--markdown", "no/such/folder/page.md"])
    assert ended.exit_code == 2
    assert "--markdown no/such/folder/page.md: cannot be written" in ended.output


def test_the_committed_validation_passes() -> None:
    page = (DOCS / "validation.md").read_text(encoding="utf-8")
    assert "**FAIL**" not in page
    assert page.count("| pass |") > 60


# --- the site --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("material", reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    to, config = str(folder), str(DOCS / "site" / "mkdocs.yml")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "-f", config, "-d", to],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_the_site_has_every_page(site: Path) -> None:
    assert {page.stem for page in PAGES} <= {page.stem for page in site.glob("*.html")}


def test_the_site_fetches_nothing_from_elsewhere(site: Path) -> None:
    tag = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*(?:src|href)=\"?(https?:|//)[^>]*>")
    for page in site.rglob("*.html"):
        outside = [
            found[0]
            for found in tag.finditer(page.read_text(encoding="utf-8"))
            if 'rel="canonical"' not in found[0]
        ]
        assert not outside, page
    for style in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:|//)", style.read_text()), style


def test_the_sites_equations_are_mathml_and_their_numbers_lead_there(site: Path) -> None:
    for page in THEORY:
        text = (site / f"{page.stem}.html").read_text(encoding="utf-8")
        numbers = re.findall(r"\\tag\{(\w+)\}", page.read_text(encoding="utf-8"))
        assert [n for n in numbers if f'id="eq-{n}"' not in text] == []
        assert "\\tag" not in text
        assert "$$" not in text
        assert text.count("<math") > len(numbers)
