"""What is made from the scenario's code: keys, reference, JSON schema, the commented scenario."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import pytest

from dualbend.errors import InputError
from dualbend.scenario.keys import REQUIRED, sections, split_unit, unit_of
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scenario.reference import reference_markdown
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.schema import scenario_schema, schema_text, shipped_schema
from dualbend.scenario.template import scenario_text, write_scenario
from dualbend.scenario.toml_text import number, toml
from dualbend.task.bending.config import misalignment_of

DOCS = Path(__file__).parents[2] / "docs"

HIDDEN = r"^#(?=\w+ = )"
"""A commented key."""


def validator() -> Any:
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft7Validator.check_schema(scenario_schema())
    return jsonschema.Draft7Validator(scenario_schema())


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("length_m", "m"),
        ("young_pa", "Pa"),
        ("density_kg_per_m3", "kg/m³"),
        ("stiffness_n_m_per_rad", "N m/rad"),
        ("stiffness_n_per_m", "N/m"),
        ("acceleration_rad_per_s2", "rad/s²"),
        ("torque_noise_nm", "N m"),
        ("natural_frequency_hz", "Hz"),
        ("damping_ratio", "-"),
        ("hinges", ""),
        ("b", ""),
    ],
)
def test_a_name_ends_with_its_unit(name: str, unit: str) -> None:
    assert unit_of(name) == unit


def test_a_unit_in_brackets_counts_at_the_end_only() -> None:
    assert split_unit("length of the FIR [samples]") == ("length of the FIR", "samples")
    assert split_unit("from [0] on") == ("from [0] on", "")


@pytest.mark.parametrize(
    "value", [0.0, 70.3e9, 1e-5, 0.2e-3, 2.5e-7, 1 / 3e7, 1e15, 1e-15, 5, -3e6]
)
def test_a_number_reads_back_exactly(value: float) -> None:
    """Exact: to the last bit, and a whole number stays one."""
    found = tomllib.loads(f"x = {number(value)}")["x"]
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize("value", ['a "b" \\ \n\x7f ü', True, ["left"], [[0.0, 1e-6]]])
def test_a_value_reads_back(value: object) -> None:
    assert tomllib.loads(f"x = {toml(value)}")["x"] == value


ANSWERS = [f"robot.{side}.response={{natural_frequency_hz=2}}" for side in ("left", "right")]


def test_the_sections_hold_every_key_of_the_code() -> None:
    """Against another source: msgspec's own dictionaries of scenarios that have every section."""
    full = load_scenario(
        "pwb",
        [
            "compliance.kind=model",
            "compliance.units=sheet",
            "compliance.x={b=1.0,k=1.0,form='static'}",
            "compliance.rotation={b=1.0,k=1.0,form='static'}",
            "compliance.schedule={}",
            "compliance.reference={}",
            "compliance.fusion={}",
            "cell.left={}",
            "cell.right={}",
            "compliance.predictor={lead_x_s=0.02,lead_rotation_s=0.02}",
            "robot.servo.integral={}",
            "robot.servo.friction_estimate={}",
            "grasp.friction=0.5",
            "imperfections.robot.zero_rad=[0, 0, 0, 0, 0, 0]",
            "imperfections.events={arm_stop={}, power_failure={}, oil={}}",
            "sensor.calibration={}",
            "serve={}",
        ],
    )

    def walk(tree: dict[str, Any], path: str) -> set[str]:
        found = set()
        for key, item in tree.items():
            found |= walk(item, f"{path}{key}.") if isinstance(item, dict) else {f"{path}{key}"}
        return found

    held = walk(msgspec.to_builtins(full), "") - {
        *("learning", "robot.left.response", "robot.right.response")
    }
    for kinds in (
        ["task.misalignment={left={},right={}}"],
        ["path=piecewise", "filter=iir", "learning={}", *ANSWERS],
        ["path.kind=pieces", "path.pieces=2", "filter=none", "compliance=none"],
        ["path=approximate", "sheet.model=shell"],
        ["path.kind=table", "path.table=[[0,0.2,0],[1.1,0.16,0.1]]"],
        ["compliance=support.controllers:Still"],
        [
            "compliance.kind=mass-spring-damper",
            *(f"compliance.{name}.b=1" for name in ("x", "y", "z", "roll", "pitch", "yaw")),
        ],
    ):
        held |= walk(msgspec.to_builtins(load_scenario("fig6", kinds)), "") - {
            *("task.misalignment", "cell.left", "cell.right"),
            *("compliance.x", "compliance.rotation", "sensor.calibration"),
            *("robot.servo.integral", "robot.servo.friction_estimate", "learning", "serve"),
            *("robot.left.response", "robot.right.response"),
            *(f"imperfections.events.{name}" for name in ("arm_stop", "power_failure", "oil")),
        }
    named = {".".join((*s.path, key.name)) for s in sections() for key in s.keys}
    # What a class is called with is its own.
    assert named - {"compliance.options"} == held


def test_every_key_says_what_it_is() -> None:
    silent = [f"{s.title}.{key.name}" for s in sections() for key in s.keys if not key.description]
    assert not silent, f"without a description: {silent}"


def test_the_committed_reference_is_current() -> None:
    page = (DOCS / "reference.md").read_text(encoding="utf-8")
    assert page == reference_markdown(), "run dualbend reference --out docs/reference.md"


def test_the_tables_of_the_reference_have_one_width() -> None:
    rows = [line for line in reference_markdown().splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {7}


def test_the_shipped_schema_is_current() -> None:
    text = shipped_schema().read_text(encoding="utf-8")
    assert text == schema_text(), (
        "run dualbend schema --out src/dualbend/scenario/scenario.schema.json"
    )


@pytest.mark.parametrize("name", list_scenarios())
def test_shipped_scenarios_are_valid(name: str) -> None:
    check = validator()
    check.validate(tomllib.loads(list_scenarios()[name].read_text(encoding="utf-8")))
    check.validate(tomllib.loads(load_scenario(name).to_toml()))  # resolved: extends nothing


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('extends = "fig6"\nlenght = 1', "lenght"),
        ('extends = "fig6"\n[sheet]\nlenght_m = 0.4', "lenght_m"),
        ('extends = "fig6"\n[sheet]\nlength_m = 4', "maximum"),
        ('extends = "fig6"\n[robot.alter]\ndelay_cycles = 1.5', "integer"),
        ('extends = "fig6"\n[path]\nkind = "straight"', "straight"),
        ('extends = "fig6"\n[robot.servo]\nstiffness_n_m_per_rad = [1.0]', "not valid"),
        ('extends = "fig6"\nname = "a b"', "a b"),
        ('name = "a"\n[path]', "sheet"),
        ('name = "a"\n[path]\n[sheet]\nlength_m = 0.4', "width_m"),
    ],
)
def test_the_schema_refuses_what_the_loader_refuses(text: str, words: str, tmp_path: Path) -> None:
    errors = " ".join(
        f"{error.message} {error.validator}"
        for error in validator().iter_errors(tomllib.loads(text))
    )
    assert words in errors
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(InputError):
        load_scenario(str(path))


@pytest.mark.parametrize(
    "text",
    [
        'extends = "fig8"\nname = "a"\n[compliance]\nx = "none"',
        'extends = "fig9"\n[compliance]\nrotation = { b = 0.3 }',
        'extends = "fig6"\n[path]\nkind = "pieces"\npieces = 4',
        'extends = "fig6"\nfilter = "none"\n[sheet]\nmodel = "shell"',
        'extends = "fig6"\n[sheet.model]\nkind = "shell"\ncells_along = 12',
        'extends = "fig6"\nseed = 9',
        'extends = "fig6"\ncompliance = "support.controllers:Still"',
        'extends = "fig6"\n[compliance]\nkind = "support.controllers:Turn"\noptions = { b = 1.0 }',
    ],
)
def test_the_schema_takes_what_the_loader_takes(text: str, tmp_path: Path) -> None:
    validator().validate(tomllib.loads(text))
    path = tmp_path / "right.toml"
    path.write_text(text)
    load_scenario(str(path))


def test_the_schema_has_no_word_that_its_readers_do_not_know() -> None:
    """Draft 7: no tuples, anchors or anything beside a reference as later drafts have, no null."""
    text = schema_text()
    for word in ("prefixItems", "$defs", "\\\\Z", "null"):
        assert word not in text

    def walk(tree: object) -> None:
        if isinstance(tree, dict):
            assert "$ref" not in tree or len(tree) == 1, tree
            for item in tree.values():
                walk(item)
        elif isinstance(tree, list):
            for item in tree:
                walk(item)

    walk(json.loads(text))


def same(found: Scenario, base: Scenario) -> bool:
    return found == msgspec.structs.replace(base, name="mine", description=found.description)


@pytest.mark.parametrize("base", list_scenarios())
def test_a_new_scenario_is_its_base(base: str, tmp_path: Path) -> None:
    """Exact: equal objects, and equal again when every comment of a live section is taken away."""
    path = write_scenario("mine", base, tmp_path)
    text = path.read_text(encoding="utf-8")
    assert same(load_scenario(str(path)), load_scenario(base))
    lines, live = [], True
    for line in text.splitlines():
        if re.match(r"#?\[", line):
            live = line.startswith("[")
        lines.append(re.sub(HIDDEN, "", line) if live else line)
    path.write_text("\n".join(lines), encoding="utf-8")
    assert "\nseed = " in path.read_text(encoding="utf-8")
    assert same(load_scenario(str(path)), load_scenario(base))


@pytest.mark.parametrize("base", list_scenarios())
def test_a_new_scenario_is_valid(base: str) -> None:
    validator().validate(tomllib.loads(scenario_text("mine", base)))


def test_a_new_scenario_names_every_key_and_hides_the_defaults() -> None:
    text = scenario_text("mine")
    for section in sections():
        if section.path:
            assert f"[{section.title}]" in text
        for key in section.keys:
            assert f"\n#{key.name} = " in text or f"\n{key.name} = " in text
    assert max(map(len, text.replace("description = ", "\n").splitlines())) <= 110
    loaded = tomllib.loads(text)
    base = load_scenario("fig6")
    by_title = {section.title: section for section in sections() if section.of(base) is not None}
    for title in ("motion", "cell", "path"):
        defaults = {key.name: key.default for key in by_title[title].keys}
        for name, value in loaded[title].items():
            assert defaults[name] is REQUIRED or defaults[name] != value


@pytest.mark.parametrize("base", ["fig6", "tuned"])
def test_what_is_switched_on_by_its_header_loads(base: str, tmp_path: Path) -> None:
    """A section that is off holds values that load when all its comment signs go.

    What is of another kind stays off.
    """
    live = load_scenario(base)

    def of_another_kind(block: str) -> bool:
        belongs = re.search(r"Of (\w+) with kind = (.*)\.", block.replace("\n# ", " "))
        if belongs and f'"{getattr(live, belongs.group(1)).kind}"' not in belongs.group(2):
            return True
        return "\n#[" in block and "\n#kind = " in block

    blocks = scenario_text("mine", base).split("\n\n")
    text = "\n\n".join(block for block in blocks if not of_another_kind(block))
    text = re.sub(r"^#(?=\[)", "", text, flags=re.MULTILINE)
    text = re.sub(HIDDEN, "", text, flags=re.MULTILINE)
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"robot\.servo\.friction_estimate: in this task the arms"):
        load_scenario(str(path), ["grasp.friction=0.5", "learning=none"])
    found = load_scenario(str(path), ["grasp.friction=0.5"])
    assert found.compliance.x is not None
    assert found.compliance.rotation is not None
    assert misalignment_of(found) is not None


def test_the_schema_line_prefers_the_file_beside(tmp_path: Path) -> None:
    first = scenario_text("mine", beside=tmp_path).splitlines()[0]
    assert first == f"#:schema {shipped_schema().as_uri()}"
    (tmp_path / "scenario.schema.json").write_text("{}")
    assert scenario_text("mine", beside=tmp_path).startswith("#:schema ./scenario.schema.json\n")


@pytest.mark.parametrize("name", ["", "a b", "../up", "-x", "fig6", "a" * 101])
def test_a_name_that_cannot_be_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="NAME"):
        write_scenario(name, folder=tmp_path)
    assert not list(tmp_path.iterdir())
