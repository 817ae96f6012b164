"""A material of one's own: its file becomes numbers of the scenario, which then needs no file."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualbend.beam.material import find_material, materials_of
from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.evaluation.sheet import sheet_report
from dualbend.evaluation.warnings import name_warnings
from dualbend.resources import models_dir
from dualbend.scenario.load import load_scenario, parse_scenario, read_materials
from dualbend.scenario.template import scenario_text

OWN = """
[PETG]
title = "PETG film"
young_pa = { value = 2.1e9, grade = "published", source = "its data sheet" }
poisson_ratio = 0.38
density_kg_per_m3 = 1270
yield_pa = 50e6
"""
WOVEN = """
[weave]
young_pa = 20e9
transverse_young_pa = 15e9
shear_pa = 4e9
poisson_ratio = 0.1
density_kg_per_m3 = 1600.0
strain_at_failure = 0.01

[PEEK]
young_pa = 3.6e9
poisson_ratio = 0.38
density_kg_per_m3 = 1300
"""
BASE = """
extends = "fig8"
name = "mine"
[sheet]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "petg.toml").write_text(OWN, encoding="utf-8")
    (tmp_path / "two.toml").write_text(WOVEN, encoding="utf-8")
    return tmp_path


def scenario_with(folder: Path, lines: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(BASE + lines, encoding="utf-8")
    return path


def test_a_file_of_the_scenarios_own_folder_gives_the_numbers(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir("/")
    found = load_scenario(str(scenario_with(folder, 'material = "petg.toml"')))
    sheet = found.sheet.sheet()
    assert (sheet.young_pa, sheet.poisson_ratio, sheet.density_kg_per_m3) == (2.1e9, 0.38, 1270.0)
    assert found.sheet.limit_strain == 50e6 / 2.1e9
    assert sheet_report(found).material == "PETG"
    # What was inherited of the base's material is gone, as with a name of the library.
    assert found.sheet.young_pa is None
    assert not name_warnings(found.sheet)


def test_a_record_needs_no_file_beside_it(folder: Path) -> None:
    found = load_scenario(str(scenario_with(folder, 'material = "two.toml:weave"')))
    shutil.rmtree(folder)
    again = parse_scenario(found.to_toml(), "scenario.toml")
    assert again == found
    assert again.sheet.sheet().anisotropy is not None  # the moduli across and in shear, too
    assert again.to_toml() == found.to_toml()


def test_a_setting_names_a_file_from_where_one_is(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    found = load_scenario("fig8", ["sheet.material=petg.toml"])
    assert found.sheet.materials is not None
    assert [each.source for each in found.sheet.materials] == ["young_pa: its data sheet"]
    # The next material takes the place of all that the file said.
    other = load_scenario("fig8", ["sheet.material=petg.toml", "sheet.material=PET"])
    assert other.sheet == load_scenario("fig8", ["sheet.material=PET"]).sheet
    with_number = load_scenario("fig8", ["sheet.young_pa=2.2e9", "sheet.material=petg.toml"])
    assert with_number.sheet.sheet().young_pa == 2.2e9


def test_layers_may_be_of_ones_own_materials(folder: Path) -> None:
    layer = '{{ material = "{}", thickness_m = 0.0002 }}'.format
    names = ("petg.toml", "two.toml:weave", "petg.toml")
    lines = f"layers = [{', '.join(map(layer, names))}]"
    found = load_scenario(str(scenario_with(folder, lines)))
    assert found.sheet.layers is not None
    assert [each.material for each in found.sheet.layers] == ["PETG", "weave", "PETG"]
    # Analytic: the mass of the layers.
    assert found.sheet.sheet().density_kg_per_m3 == pytest.approx((2 * 1270 + 1600) / 3)
    assert parse_scenario(found.to_toml(), "scenario.toml") == found


def test_materials_that_the_scenario_has_already_stay_beside_those_of_files(folder: Path) -> None:
    lines = """
layers = [
    { material = "inline", thickness_m = 0.0002 },
    { material = "petg.toml", thickness_m = 0.0002 },
    { material = "inline", thickness_m = 0.0002 },
]
[[sheet.materials]]
name = "inline"
young_pa = 3e9
poisson_ratio = 0.3
density_kg_per_m3 = 1000.0
"""
    found = load_scenario(str(scenario_with(folder, lines))).sheet
    assert [each.name for each in found.materials or ()] == ["inline", "PETG"]
    assert found.sheet().density_kg_per_m3 == pytest.approx((2 * 1000 + 1270) / 3)


def test_a_scenario_made_from_it_loads(folder: Path) -> None:
    path = scenario_with(folder, 'material = "petg.toml"')
    (folder / "new.toml").write_text(scenario_text("new", str(path)), encoding="utf-8")
    shutil.move(folder / "petg.toml", folder / "gone.toml")
    made = load_scenario(str(folder / "new.toml")).sheet
    assert made.materials is not None
    assert made.sheet().young_pa == 2.1e9


def test_the_library_is_a_file_like_ones_own() -> None:
    path = models_dir() / "materials" / "materials.toml"
    read = read_materials(path)
    assert read["FR-4"] == find_material("FR-4")
    assert read["FR-4"].evidence == find_material("FR-4").evidence


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('material = "none.toml"', "none.toml: cannot be read"),
        (
            'material = "two.toml"',
            "two.toml holds 2 materials: add the name .*two.toml:weave",
        ),
        ('material = "two.toml:wave"', "two.toml holds weave, PEEK, not 'wave'"),
        ('material = "empty.toml"', "empty.toml: holds no material: it needs a table for each"),
        ('material = "bad.toml"', r"\[A\] yuong_pa: unknown key; valid here: title, young_pa"),
        ('material = "flat.toml"', r"young_pa: a material is a table: put \[NAME\] above"),
        ('material = "few.toml"', r"\[A\] poisson_ratio, density_kg_per_m3: missing"),
        ('material = "word.toml"', r"\[A\] young_pa = 'stiff': needs a number"),
        ('material = "grade.toml"', r"\[A\] young_pa: needs a number, or { value, grade, source }"),
        ('material = "soft.toml"', r"soft.toml': \[A\]: young_pa = 1\.0: must be a number ≥ 100e6"),
        ('material = "library.toml"', "materials\\[0\\].name = 'PET': the library has this name"),
    ],
)
def test_what_is_no_material_is_refused_with_its_place(
    folder: Path, lines: str, message: str
) -> None:
    rest = "poisson_ratio = 0.3\ndensity_kg_per_m3 = 1000.0\n"
    for name, text in {
        "empty": "",
        "bad": "[A]\nyuong_pa = 1e9\n",
        "flat": "young_pa = 1e9\n",
        "few": "[A]\nyoung_pa = 1e9\n",
        "word": f'[A]\nyoung_pa = "stiff"\n{rest}',
        "grade": f'[A]\nyoung_pa = {{ value = 1e9, grade = "sure" }}\n{rest}',
        "soft": f"[A]\nyoung_pa = 1.0\n{rest}",
        "library": f"[PET]\nyoung_pa = 1e9\n{rest}",
    }.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_scenario(str(scenario_with(folder, lines)))


def test_a_material_without_evidence_has_none() -> None:
    (found,) = materials_of(
        {"A": {"young_pa": 1e9, "poisson_ratio": 0.3, "density_kg_per_m3": 1e3}}
    ).values()
    assert not found.evidence


def test_the_command_lists_a_file_with_its_sources(folder: Path) -> None:
    said = CliRunner().invoke(main, ["materials", str(folder / "petg.toml")]).output
    assert "PETG: PETG film" in said
    assert "published: its data sheet" in said
    assert "5e+07" in said
    wrong = CliRunner().invoke(main, ["materials", str(folder / "none.toml")])
    assert wrong.exit_code == 2
