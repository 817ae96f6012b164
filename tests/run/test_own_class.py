"""A controller of the user's own that a scenario names: found, checked, run, kept, predicted."""

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from dualbend import load_run, load_scenario, make_run, predict, write_results
from dualbend import registry as registered
from dualbend.cli import main
from dualbend.control.compliance.own import OwnComplianceConfig, OwnController
from dualbend.errors import InputError
from dualbend.report.page import report
from dualbend.run.known_sheet import make_compliance
from dualbend.run.record import RunRecord
from dualbend.scenario.load import parse_scenario
from dualbend.study.tuning.gains import knobs, softened, turned
from dualbend.study.tuning.search import Margin
from dualbend.study.tuning.tuning import tune
from support.controllers import Listener
from support.short_bend import SHORT

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "own_admittance.toml"
BOTH = 'compliance.sensing=["left","right"]'
MINE = """
import numpy as np
import helper_of_{name}

class Mine:
    gains = ("b",)

    def __init__(self, scenario, b=2.0):
        self.b, self.name = b, helper_of_{name}.NAME

    def __call__(self, observation):
        deviation = np.zeros((2, 6))
        deviation[0, 4] = observation.filtered.torque_nm[0, 1] / self.b
        return deviation

class Other(Mine):
    pass
"""


def equal(one: RunRecord, other: RunRecord) -> bool:
    """Tell whether a run has every column of another one to the bit, but for the time it took."""
    names = [name for name, _ in other.trace.columns if name != "wall_s"]
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in names)


def refused(settings: Any, name: str = "fig6") -> str:
    with pytest.raises(InputError) as caught:
        make_run(load_scenario(name, settings))
    return str(caught.value)


@pytest.fixture
def folders(tmp_path: Path) -> Iterator[tuple[Path, Path]]:
    """Two folders with a module of the same name, each with a scenario beside it."""
    path, before = list(sys.path), set(sys.modules)
    found = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "mine.py").write_text(MINE.format(name=name))
        (folder / f"helper_of_{name}.py").write_text(f"NAME = {name!r}")
        (folder / "mine.toml").write_text(
            'extends = "fig8"\nname = "mine"\n[compliance]\nkind = "mine:Mine"\n'
        )
        found.append(folder)
    yield found[0], found[1]
    sys.path[:] = path
    for name in set(sys.modules) - before:
        if name == "mine" or name.startswith("helper_of_"):
            del sys.modules[name]
    registered._IMPORTED.pop("mine", None)


# --- it is the built-in admittance -----------------------------------------------------------


@pytest.mark.parametrize("settings", [SHORT, pytest.param((), marks=pytest.mark.slow)])
def test_the_papers_admittance_as_a_class_makes_the_trace_of_the_built_in_one(
    settings: tuple[str, ...],
) -> None:
    """Exact to the bit: the same products in the same order."""
    own = make_run(load_scenario(str(EXAMPLE), settings)).run()
    assert own.outcome == "completed"
    assert np.abs(own["left_deviation_alpha"]).max() > 1e-3
    assert equal(own, make_run(load_scenario("fig8", settings)).run())
    softer = make_run(load_scenario(str(EXAMPLE), [*settings, "compliance.options.b=0.51"])).run()
    assert not equal(own, softer)


def test_its_bounds_are_recorded_as_those_of_the_built_in_one() -> None:
    """Exact: the same cycles."""
    own, built_in = (
        make_run(load_scenario(name, [*SHORT, f"compliance.{limit}=2e-3"])).run()
        for name, limit in ((str(EXAMPLE), "options.limit"), ("fig8", "limit_rotation_rad"))
    )
    assert 0.0 < np.nansum(own["saturated"]) < own.trace.rows
    assert equal(own, built_in)


def test_the_class_of_the_example_is_as_short_as_is_said() -> None:
    text = EXAMPLE.with_suffix(".py").read_text()
    body = text[text.index("class PaperAdmittance") : text.index("def main")].strip()
    assert len(body.splitlines()) <= 25


def test_its_prediction_is_that_of_the_built_in_one() -> None:
    """Exact: the same transfer function; what is of b and k alone is not said."""
    own, built_in = (
        predict(load_scenario(name, ["path.end_rad=0.4"])) for name in (str(EXAMPLE), "fig8")
    )
    assert len(own.rows) == len(built_in.rows)
    for mine, theirs in zip(own.rows, built_in.rows, strict=True):
        assert mine.spectral_radius == pytest.approx(theirs.spectral_radius, rel=1e-12)
        assert mine.gain_margin_db == pytest.approx(theirs.gain_margin_db, rel=1e-12)
        assert mine.stiffness_rotation_nm_per_rad == theirs.stiffness_rotation_nm_per_rad
        assert mine.paper_stable is mine.delayed_stable is mine.delayed_gain_margin_db is None
        assert theirs.paper_stable is True


# --- what it returns ---------------------------------------------------------------------------


def test_one_arms_deviation_is_of_the_arm_that_complies() -> None:
    settings = ["compliance=support.controllers:Turn", "compliance.options.b=50.0", *SHORT]
    left = make_run(load_scenario("fig6", settings)).run()
    assert np.abs(left["left_deviation_alpha"]).max() > 1e-3
    assert not np.any(left["right_deviation_alpha"])
    right = make_run(load_scenario("fig6", [*settings, 'compliance.complying=["right"]'])).run()
    assert np.abs(right["right_deviation_alpha"]).max() > 1e-3
    assert not np.any(right["left_deviation_alpha"])


@pytest.mark.parametrize(
    ("gives", "complying", "said"),
    [
        ("1.0", '["left"]', "its deviation is of shape (), not (2, 6)"),
        ("[0.0,0.0,0.0,0.0,0.1,0.0]", '["left","right"]', "of shape (6,), not (2, 6)"),
        ("[[0,0,0,0,0,0],[0,0,0,0,0.1,0]]", '["left"]', "moves the right arm, which is not in"),
        ('"none of it"', '["left"]', "could not convert string to float"),
        (None, '["left"]', "KeyError: 'gain' (controllers.py:"),
    ],
)
def test_what_it_returns_wrongly_ends_the_run_with_its_name_and_cycle(
    gives: str | None, complying: str, said: str
) -> None:
    settings = ["compliance=support.controllers:Fails", f"compliance.complying={complying}"]
    settings += [] if gives is None else [f"compliance.options.gives={gives}"]
    result = make_run(load_scenario("exact", [*settings, *SHORT])).run()
    assert result.outcome == "failed"
    assert "controller support.controllers:Fails, cycle 5: " in result.reason
    assert said in result.reason


def test_it_is_told_the_same_in_bending_and_in_an_assembly() -> None:
    """Exact: wrenches and poses have the same shapes, and an assembly's place is the trace's."""
    Listener.made.clear()
    own = ["compliance=support.controllers:Listener", BOTH]
    bending = make_run(load_scenario("fig6", [*own, *SHORT])).run()
    bent = Listener.made[-1].told
    run = make_run(load_scenario("pwb", own))
    run.begin()
    for _ in range(20):
        assert run.step()
    assembled = Listener.made[-1].told
    assert len(bent) == bending.trace.rows
    assert len(assembled) == 20
    for one, other in ((bent[-1], assembled[-1]),):
        for name in ("raw", "filtered"):
            assert getattr(one, name).components.shape == (2, 6)
            assert getattr(other, name).components.shape == (2, 6)
        assert one.joints_rad.shape == other.joints_rad.shape == (12,)
        assert one.measured.coordinates.shape == other.measured.coordinates.shape == (2, 3)
        assert one.nominal.coordinates.shape == other.nominal.coordinates.shape == (2, 3)
        assert (one.phase, other.phase) == ("hold", "approach")
    assert not bent[-1].place.any()
    for name, i in (("x", 0), ("y", 1), ("z", 2), ("yaw", 3)):
        assert [o.place[i] for o in assembled] == run.trace[f"place_{name}"].tolist()
    # Carried to their place, the nominal grips are where the encoders tell them to be.
    off = assembled[-1].measured.z_m - assembled[-1].nominal.z_m - assembled[-1].place[2]
    assert np.abs(off).max() < 0.01  # they begin to move: the response's lag, of 0.7 m


def test_a_class_of_ones_own_lays_a_sheet() -> None:
    """The assembly as it is without any arm's own compliance: the class does nothing."""
    run = make_run(load_scenario("pwb", ["compliance=support.controllers:Still", BOTH]))
    other = make_run(load_scenario("pwb"))
    for each in (run, other):
        each.begin()
        for _ in range(40):
            each.step()
    np.testing.assert_array_equal(
        run.trace["left_setpoint_joint1"], other.trace["left_setpoint_joint1"]
    )


def test_a_factory_takes_the_place_of_the_compliance_of_an_assembly() -> None:
    run = make_run(load_scenario("pwb"), compliance=lambda _: lambda _: np.full((2, 6), 1e-3))
    run.begin()
    run.step()
    assert run.trace["left_deviation_alpha"][0] == 1e-3
    assert "lambda" in run.record("completed").controller


# --- found -------------------------------------------------------------------------------------


def test_its_module_is_found_beside_the_file_from_anywhere(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in (*folders, folders[0]):
        scenario = load_scenario(f"{folder.name}/mine.toml", SHORT)
        config = scenario.compliance
        assert isinstance(config, OwnComplianceConfig)
        assert config.options == {"b": 2.0}
        # The module of this folder, not the one of the same name that was there before.
        assert config.made_by()(scenario).name == folder.name
        assert parse_scenario(scenario.to_toml(), "saved") == scenario
    # Nothing of a folder hides a module that others import.
    assert sys.path[0] not in {str(folder) for folder in folders}


def test_a_setting_finds_it_in_the_working_folder_or_beside_the_scenario(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(folders[0])
    found = load_scenario("fig8", ["compliance=mine:Mine"]).compliance
    assert isinstance(found, OwnComplianceConfig)
    assert found.folder == str(folders[0].resolve())
    monkeypatch.chdir(tmp_path)
    found = load_scenario("b/mine.toml", ["compliance.kind=mine:Other", BOTH]).compliance
    assert isinstance(found, OwnComplianceConfig)
    assert found.folder == str(folders[1].resolve())
    assert "no module mine beside the scenario's file" in refused(["compliance=mine:Mine"])


def test_a_module_of_a_name_that_is_taken_is_refused(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    (folders[0] / "json.py").write_text((folders[0] / "mine.py").read_text())
    monkeypatch.chdir(folders[0])
    assert "another module json is loaded already" in refused(["compliance=json:Mine"])
    assert sys.modules["json"] is json


def test_a_run_is_read_again_where_its_module_is_gone(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    result = make_run(load_scenario(str(folders[0] / "mine.toml"), SHORT)).run()
    assert write_results(result, tmp_path / "run", record=False) == []
    saved = str(tmp_path / "run" / "scenario.toml")
    assert equal(make_run(load_scenario(saved)).run(), result)
    (folders[0] / "mine.py").unlink()
    del sys.modules["mine"]
    assert "does not run the code of mine:Mine" in report([load_run(tmp_path / "run")])
    assert load_run(tmp_path / "run").scenario == result.scenario
    assert "no module mine in" in refused([], saved)


def test_an_installed_package_brings_a_controller_by_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = {"turning": "support.controllers:Turn"}
    for module in ("dualbend.registry", "dualbend.scenario.load"):
        monkeypatch.setattr(f"{module}.own_names", lambda: names)
    settings = ["compliance=turning", "compliance.options.b=50.0", *SHORT]
    found = load_scenario("fig6", settings)
    assert isinstance(found.compliance, OwnComplianceConfig)
    assert found.compliance.controller == "turning"
    assert np.abs(make_run(found).run()["left_deviation_alpha"]).max() > 1e-3


def test_another_class_replaces_the_section_and_the_same_one_leaves_its_options() -> None:
    own = "support.controllers:Turn"
    base = [f"compliance={own}", "compliance.options.b=2.0", BOTH]
    same = load_scenario("fig6", [*base, "compliance.options.times=3"]).compliance
    assert isinstance(same, OwnComplianceConfig)
    assert same.options == {"b": 2.0, "times": 3}
    assert same.sensing == ("left", "right")
    text = load_scenario("fig6", base).to_toml()
    again = parse_scenario(text, "saved")
    assert again.compliance == load_scenario("fig6", base).compliance


def test_a_file_that_names_another_class_has_none_of_the_options(tmp_path: Path) -> None:
    kind = '[compliance]\nkind = "support.controllers:{}"\n'
    (tmp_path / "a.toml").write_text(
        f'extends = "fig6"\nname = "a"\n{kind.format("Turn")}options = {{ b = 2.0 }}\n'
    )
    (tmp_path / "b.toml").write_text(f'extends = "a.toml"\n{kind.format("Still")}')
    (tmp_path / "c.toml").write_text(
        f'extends = "a.toml"\n{kind.format("Turn")}options = {{ times = 2 }}\n'
    )
    found = [load_scenario(str(tmp_path / f"{name}.toml")).compliance for name in "bc"]
    assert [getattr(each, "options", None) for each in found] == [{}, {"b": 2.0, "times": 2}]


# --- refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["compliance=nowhere:Mine"], "compliance.kind = 'nowhere:Mine': no module nowhere"),
        (["compliance=support.controller:Turn"], "no module support.controller"),
        (["compliance=support.controllers:Trun"], "has no Trun; did you mean Turn?"),
        (["compliance=math:pi"], "pi is 3.14159"),
        (["compliance=pathlib:Path"], "a class without __call__(self, observation)"),
        (["compliance=:Mine"], 'needs "module:Class"'),
        (["compliance=own", "compliance.controller=Mine"], 'needs "module:Class"'),
        (["compliance=own"], "`controller`"),
        (
            ["compliance=mine"],
            "must be one of 'admittance', 'model', 'mass-spring-damper', 'own', 'none'; "
            '"module:Class" for a class of your own',
        ),
        (["compliance=mine.py:Mine"], 'with a module, not a file: "mine:Mine"'),
        (["compliance=support.controllers:Turn"], "compliance.options: "),
        (["compliance=support.controllers:Turn"], "missing required field `b`"),
        (
            ["compliance=support.controllers:Turn", "compliance.options.b=-1"],
            "compliance.options.b = -1: ",
        ),
        (
            ["compliance=support.controllers:Turn", "compliance.options.b=soft"],
            "compliance.options.b = 'soft': must be a number > 0",
        ),
        (
            ["compliance=support.controllers:Turn", "compliance.options={b=1.0,time=2}"],
            "compliance.options.time = 2: unknown key; did you mean times? valid here: b, times",
        ),
        (["compliance=support.controllers:Raises"], "ValueError: no licence (controllers.py:"),
        (["compliance=support.controllers:CONTROL"], "has no CONTROL"),
        (["compliance=support.controllers:Leaves"], "SystemExit: bye (controllers.py:"),
        (["compliance=support..controllers:Turn"], 'needs "module:Class"'),
        (
            ["compliance=support.controllers:Typed", "compliance.options.weights=[1.0, 'a']"],
            "compliance.options.weights",
        ),
        (
            ["compliance=support.controllers:Typed", "compliance.options.weights=3"],
            "compliance.options.weights = 3: must be a list of numbers",
        ),
        (
            ["compliance=support.controllers:Typed", "compliance.options.mode=c"],
            "compliance.options.mode = 'c': must be one of 'a', 'b'",
        ),
        (["compliance=builtins:repr"], "makes a str, which cannot be called with an observation"),
    ],
)
def test_what_is_no_controller_is_refused_with_its_key(settings: list[str], said: str) -> None:
    message = refused(settings)
    assert said in message
    assert message.startswith(("fig6.toml with --set: compliance", "scenario 'fig6': compliance"))


def test_options_of_types_that_no_file_holds_are_passed_as_they_are() -> None:
    options = "{weights=[1,2],table=[[1.0],[2.0]],either='x',later=[3]}"
    settings = ["compliance=support.controllers:Typed", f"compliance.options={options}"]
    made = make_compliance(load_scenario("fig6", settings))
    assert isinstance(made, OwnController)
    assert getattr(made.controller, "given", ()) == ([1.0, 2.0], [[1.0], [2.0]], "x", [3], "a")
    made = make_compliance(load_scenario("fig6", ["compliance=support.controllers:partly"]))
    assert isinstance(made, OwnController)
    assert getattr(made.controller, "b", 0.0) == 3.0


def test_an_error_of_its_syntax_is_told_with_its_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "half_written.py").write_text("import math\nclass Mine\n")
    (tmp_path / "x.toml").write_text('extends = "fig6"\ncompliance = "half_written:Mine"\n')
    with pytest.raises(InputError, match=r"SyntaxError: .* \(half_written\.py, line 2\)$"):
        load_scenario(str(tmp_path / "x.toml"))


def test_the_command_refuses_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "broken_module.py").write_text("import nothing_of_the_kind\n")
    (tmp_path / "x.toml").write_text('extends = "fig6"\ncompliance = "broken_module:Mine"\n')
    ended = CliRunner().invoke(main, ["run", str(tmp_path / "x.toml"), "--no-record"])
    assert ended.exit_code == 2
    lines = ended.output.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("dualbend: x.toml: compliance.kind = 'broken_module:Mine': ")
    assert "No module named 'nothing_of_the_kind' (broken_module.py:1)" in lines[0]


# --- predicted and tuned -----------------------------------------------------------------------


def test_without_transfer_functions_a_loop_is_not_predicted() -> None:
    scenario = load_scenario("fig6", ["compliance=support.controllers:Still"])
    with pytest.raises(InputError, match="no method transfer_functions"):
        predict(scenario)


@pytest.mark.parametrize("option", ["--map=x.png", "--validate"])
@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ([str(EXAMPLE)], "a class of your own"),
        (["fig8", "--set", 'compliance={kind="mass-spring-damper",pitch={b=9}}'], "has m, b and k"),
    ],
)
def test_its_loop_is_no_point_of_a_map(option: str, kind: list[str], said: str) -> None:
    ended = CliRunner().invoke(main, ["stability", *kind, option])
    assert ended.exit_code == 2
    assert f"{option.partition('=')[0]}: scenario" in ended.output
    assert f"{said}" in ended.output


def test_a_search_turns_the_gains_that_the_class_names_and_no_other() -> None:
    config = load_scenario(str(EXAMPLE)).compliance
    assert isinstance(config, OwnComplianceConfig)
    names = [knob.key for knob in knobs(config, 1.0)]
    assert names == ["b", "k"]
    by_two = turned(config, knobs(config, 1.0)[0], 2.0, 0.028)
    assert isinstance(by_two, OwnComplianceConfig)
    assert by_two.options == {"b": 1.0, "k": 10000.0, "limit": 0.1}
    stiff = softened(config, 0.5)
    assert isinstance(stiff, OwnComplianceConfig)
    assert stiff.options == {"b": 1.0, "k": 20000.0, "limit": 0.1}


@pytest.mark.slow
def test_tune_finds_gains_for_a_class() -> None:
    scenario = load_scenario(str(EXAMPLE), SHORT)
    found = tune(scenario, required=Margin(gain_db=6.0, phase_deg=30.0), seeds=3)
    config = found.found.compliance
    assert isinstance(config, OwnComplianceConfig)
    assert config.options["limit"] == 0.1
    assert found.found.margin.gain_db >= 6.0


def test_a_class_without_gains_is_not_tuned() -> None:
    own = ["compliance=support.controllers:Turn", "compliance.options.b=2.0"]
    with pytest.raises(InputError, match="names no option that tune may change"):
        tune(load_scenario("fig6", own), required=Margin(gain_db=6.0, phase_deg=30.0))


# --- elsewhere ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_sweep_in_two_processes_varies_its_options(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    """Exact: the processes, which are new, make the runs of this one."""
    short = "".join(f"{setting}\n" for setting in SHORT)
    (folders[0] / "sweep.toml").write_text(
        f'scenario = "mine.toml"\nmetrics = ["peak_moment"]\n[set]\n{short}[sample]\n'
        'kind = "grid"\n[keys]\n"compliance.options.b" = { min = 1.0, max = 3.0, steps = 3 }\n'
    )
    out = tmp_path / "out"
    arguments = ["sweep", str(folders[0] / "sweep.toml"), "--workers", "2", "--out", str(out)]
    ended = CliRunner().invoke(main, arguments, env={**os.environ})
    assert ended.exit_code == 0, ended.output
    rows = [json.loads(line) for line in (out / "runs.jsonl").read_text().splitlines()]
    found = {row["index"]: row["metrics"]["peak_moment"]["value"] for row in rows}
    for i, b in enumerate((1, 2, 3)):
        settings = [*SHORT, f"compliance.options.b={b}"]
        here = make_run(load_scenario(str(folders[0] / "mine.toml"), settings)).run()
        assert found[i] == here.metrics["peak_moment"].value
    assert len(set(found.values())) == 3


def test_a_scenario_that_was_moved_finds_the_module_that_was_moved_with_it(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    text = load_scenario(str(folders[0] / "mine.toml")).to_toml()
    moved = tmp_path / "moved"
    folders[0].rename(moved)
    (moved / "scenario.toml").write_text(text)
    found = load_scenario(str(moved / "scenario.toml")).compliance
    assert isinstance(found, OwnComplianceConfig)
    assert found.folder == str(moved)


def test_what_a_class_names_is_checked_also_where_it_takes_any_other(tmp_path: Path) -> None:
    (tmp_path / "open.py").write_text(OPEN, encoding="utf-8")
    file = tmp_path / "open.toml"
    text = 'extends = "fig6"\nname = "open"\ncompliance = {{ kind = "open:Open", options = {} }}\n'
    file.write_text(text.format("{ b = 2.0, other = 3 }"), encoding="utf-8")
    found = load_scenario(str(file)).compliance
    assert isinstance(found, OwnComplianceConfig)
    assert found.options == {"b": 2.0, "other": 3}
    file.write_text(text.format('{ b = "x", other = 3 }'), encoding="utf-8")
    with pytest.raises(InputError, match=r"compliance\.options\.b"):
        load_scenario(str(file))


OPEN = """
class Open:
    def __init__(self, scenario, b: float = 1.0, **others):
        self.others = others

    def __call__(self, observation):
        raise NotImplementedError
"""
