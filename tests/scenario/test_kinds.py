"""Sections of several kinds, settings as a dictionary, and keys that have another name now."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualbend.control.compliance.admittance import AdmittanceConfig, NoComplianceConfig
from dualbend.control.filters import FirConfig, IirConfig, NoFilterConfig
from dualbend.errors import InputError
from dualbend.run.arms import joint_stiffness
from dualbend.scenario.load import load_scenario
from dualbend.scenario.path import ExactPathConfig, PiecesPathConfig, TablePathConfig
from dualbend.scene.sheet.shell import ShellConfig

SIX = "[1e4,1e4,1e4,2e3,2e3,2e3]"


def refused(settings: Any, name: str = "fig6") -> str:
    with pytest.raises(InputError) as caught:
        load_scenario(name, settings)
    return str(caught.value)


@pytest.mark.parametrize(
    ("settings", "section", "expected"),
    [
        (["filter=none"], "filter", NoFilterConfig()),
        (["filter.kind=iir", "filter.order=4"], "filter", IirConfig(order=4)),
        (["filter.order=4", "filter=iir"], "filter", IirConfig(order=4)),
        (["filter.taps=5"], "filter", FirConfig(taps=5)),
        (["compliance=none"], "compliance", NoComplianceConfig()),
        (["compliance.tare=true"], "compliance", AdmittanceConfig(tare=True)),
        (["path.pieces=4", "path.kind=pieces"], "path", PiecesPathConfig(pieces=4)),
        (["path=exact"], "path", ExactPathConfig()),
        (
            ["path.kind=table", "path.table=[[0,0.2,0],[1.1,0.16,0.1]]"],
            "path",
            TablePathConfig(table=((0.0, 0.2, 0.0), (1.1, 0.16, 0.1))),
        ),
    ],
)
def test_a_kind_replaces_the_section_before_its_keys(
    settings: list[str], section: str, expected: object
) -> None:
    assert getattr(load_scenario("fig6", settings), section) == expected


@pytest.mark.parametrize("order", [1, -1])
def test_the_short_form_of_a_kind_keeps_its_place_before_the_keys(order: int) -> None:
    settings = ["sheet.model=shell", "sheet.model.cells_along=12"][::order]
    assert load_scenario("springback", [*settings, "sheet.plastic=false"]).sheet.model == (
        ShellConfig(cells_along=12)
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["filter=iri"], "filter.kind = 'iri': must be one of 'fir', 'iir', 'none'; did you mean"),
        (["filter.kind=3"], "filter.kind = 3"),
        (["filter.kind=[1]"], "filter.kind = [1]: must be one of 'fir'"),
        (
            ["path.pieces=4"],
            'path.pieces = 4: belongs to kind = "pieces", this path is "piecewise"',
        ),
        (
            ["filter=none", "filter.cutoff_hz=4"],
            'filter.cutoff_hz = 4: belongs to kind = "fir" or "iir", this filter is "none"',
        ),
        (
            ["compliance.schedule={}"],
            'compliance.schedule = {...}: belongs to kind = "model", this compliance is "admitt',
        ),
        (["sheet.model.cells_along=12"], 'belongs to kind = "shell", this model is "strips"'),
        (["sheet.model=none"], "sheet.model.kind = 'none': must be one of 'strips', 'shell'"),
        (["path.kind=pieces"], "`pieces`, as kind = \"pieces\" needs; the kinds are 'piecewise'"),
        (["filter.taps.x=3"], "'taps' is a value"),
    ],
)
def test_what_is_of_no_kind_or_another_is_refused(settings: list[str], message: str) -> None:
    assert message in refused(settings)


def test_the_file_that_holds_a_wrong_kind_is_named(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text('extends = "fig6"\nname = "b"\n[filter]\nkind = "fri"\n')
    top = tmp_path / "top.toml"
    top.write_text('extends = "base.toml"\nname = "t"\n')
    assert refused((), str(top)).startswith("base.toml: filter.kind = 'fri'")


def test_an_inherited_kind_stays(tmp_path: Path) -> None:
    path = tmp_path / "child.toml"
    path.write_text('extends = "tuned"\nname = "c"\n[compliance]\nfusion = "none"\n')
    found, base = load_scenario(str(path)).compliance, load_scenario("tuned").compliance
    assert (found.kind, found.fusion, found.schedule) == ("model", None, base.schedule)


@pytest.mark.parametrize(
    ("tables", "texts"),
    [
        ({"sheet": {"width_m": 0.06}}, ["sheet.width_m=0.06"]),
        ({"path": "exact", "filter": {"kind": "iir"}}, ["path=exact", "filter.kind=iir"]),
        (
            {"robot": {"model": "ur5", "left": {"model": None}}, "cell": {"base_yaw_rad": 0.1}},
            ["cell.base_yaw_rad=0.1", "robot.model=ur5"],
        ),
        ({"compliance": {"sensing": ("left", "right")}}, ['compliance.sensing=["left","right"]']),
        ({"sheet": {"width_m": np.float64(0.06)}}, ["sheet.width_m=0.06"]),
        ({"cell": {"home_rad": np.arange(6.0)}}, ["cell.home_rad=[0.0,1.0,2.0,3.0,4.0,5.0]"]),
        ({"filter": IirConfig(order=3)}, ["filter.kind=iir", "filter.order=3"]),
        ({}, []),
    ],
)
def test_a_dictionary_says_what_texts_say(tables: dict[str, Any], texts: list[str]) -> None:
    assert load_scenario("fig6", tables) == load_scenario("fig6", texts)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"sheet": {"widht_m": 0.06}},
            "fig6.toml with settings: sheet.widht_m = 0.06: unknown key",
        ),
        (
            {"sheet": {"width_m": "wide"}},
            "sheet.width_m = 'wide': must be a number ≥ 0.005, ≤ 3 [m]",
        ),
        ({"sheet": {"width_m": float("nan")}}, "sheet.width_m = nan: must be a finite number"),
        ({"sheet": {"width_m": {"x": 1}}}, "settings: 'width_m' is a value, not a section"),
        ({"sheet": {"width_m": object()}}, "settings: need numbers, texts, lists and tables"),
        ({3: 4}, "3 = 4: unknown key"),
        ({"robot": "ur5"}, "robot = 'ur5': must be a section with keys: model, arm, left, "),
        (
            {"path": 4},
            "path = 4: must be a section, or the name of its kind: 'piecewise'",
        ),
        (
            {"task": 3},
            "task = 3: must be a section, or the name of its kind: 'bending'",
        ),
        ({"alter": {"delay_cycles": 3}}, "alter.delay_cycles is now robot.alter.delay_cycles"),
    ],
)
def test_a_wrong_dictionary_is_refused_as_a_text_is(tables: dict[str, Any], message: str) -> None:
    assert message in refused(tables)


RENAMED = {
    "arm.model": "robot.model",
    "arm.left": "robot.left.model",
    "arm.right": "robot.right.model",
    "response.natural_frequency_hz": "robot.response.natural_frequency_hz",
    "response.damping_ratio": "robot.response.damping_ratio",
    "servo.stiffness_n_m_per_rad": "robot.servo.stiffness_n_m_per_rad",
    "servo.damping_ratio": "robot.servo.damping_ratio",
    "alter.mode": "robot.alter.mode",
    "alter.delay_cycles": "robot.alter.delay_cycles",
    "arms.sensing": "compliance.sensing",
    "arms.complying": "compliance.complying",
    "sheet.strips.hinges": "sheet.model.hinges",
    "sheet.shell.cells_along": "sheet.model.cells_along",
}


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_key_is_refused_naming_the_new_one(old: str, new: str, tmp_path: Path) -> None:
    assert f"fig6.toml with --set: {old} is now {new}" == refused([f"{old}=1"])
    path = tmp_path / "old.toml"
    path.write_text(f'extends = "fig6"\nname = "old"\n{old} = 1\n')
    assert f"old.toml: {old} is now {new}" == refused((), str(path))


def test_one_side_has_an_arm_and_a_stiffness_of_its_own() -> None:
    robot = load_scenario("fig6", ["robot.right.model=ur5"]).robot
    assert (robot.of("left"), robot.of("right")) == ("puma560", "ur5")
    both = joint_stiffness(load_scenario("fig6"))
    one = joint_stiffness(load_scenario("fig6", [f"robot.left.servo.stiffness_n_m_per_rad={SIX}"]))
    assert one.tolist() == [1e4, 1e4, 1e4, 2e3, 2e3, 2e3, *both[6:]]


def test_another_arm_takes_back_the_stiffness_of_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "stiff.toml"
    path.write_text(
        f'extends = "fig6"\nname = "stiff"\n[robot.servo]\nstiffness_n_m_per_rad = {SIX}\n'
        f"[robot.right.servo]\nstiffness_n_m_per_rad = {SIX}\n"
    )
    robot = load_scenario(str(path), ["robot.right.model=panda"]).robot
    assert robot.stiffness_n_m_per_rad("right") is None
    assert "robot.right.servo.stiffness_n_m_per_rad has 6 values, the right arm 'panda'" in refused(
        [f"robot.right.servo.stiffness_n_m_per_rad={SIX}", "robot.right.model=panda"]
    )
