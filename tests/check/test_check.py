"""The comparison with a baseline: what it lets pass, what it catches, and what it says of that."""

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from dualbend.check import report as check_report
from dualbend.check.baseline import Baseline, read_baseline, write_baseline
from dualbend.check.check import check, updated
from dualbend.check.measure import Measured, measure, measure_all
from dualbend.check.settings import changed_settings, settings_of
from dualbend.check.tolerances import Tolerance, better_where, default_tolerance
from dualbend.check.verdict import Finding, Verdicts, compare
from dualbend.cli import main
from dualbend.control.delay import TransportDelay
from dualbend.errors import InputError
from dualbend.evaluation.fingerprint import model_fingerprint
from dualbend.evaluation.metrics import bending_rows
from dualbend.evaluation.peaks import Place, peak_places
from dualbend.run.make import make_run
from dualbend.run.record import Metric
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP6, STRIP8, STRIP9

SHORT = """extends = "STRIP"
name = "{name}"
[path]
end_rad = 0.8
[motion]
speed_rad_per_s = 0.2
settle_s = 0.2
hold_s = 0.1
""".replace("STRIP", STRIP8)

MUTATIONS = {
    "modulus": "[sheet]\nyoung_pa = 73.815e9\n",  # 5 % more
    "damping": "[compliance]\nx = { b = 7.35 }\nrotation = { b = 0.525 }\n",  # 5 % more
    "delay": "[robot.alter]\ndelay_cycles = 3\n",  # one cycle more
    "fir": "[filter]\ntaps = 3\n",  # one tap more
    "untouched": "",
}

_NO_TURN = "ik_rotation_residual_max"
"""Metric that is exactly 0 where the solver's last step leaves no turn at all."""

VERSIONS = {"mujoco": "4.0.0", "numpy": "2.4.6", "dualbend": "0.1.0"}


SETTINGS = {"seed": 1, "sheet": {"width_m": 0.06}, "compliance.x": {"b": 7.0, "form": "printed"}}


def measured(**metrics: float | list[float | None] | None) -> Measured:
    return Measured(
        name="x",
        source="x.toml",
        task="bending",
        outcome="completed",
        model_sha256="m",
        settings=SETTINGS,
        versions=VERSIONS,
        metrics={name: Metric(value, "N m") for name, value in metrics.items()},
        places={"peak_moment": [Place(time_s=1.5, phase="bend")]},
    )


def baseline_of(one: Measured) -> Baseline:
    return updated(Baseline(), [one], Path("baseline.json"))


def judge(old: Measured, new: Measured) -> Verdicts:
    return compare(baseline_of(old), [new])


def verdict(old: float | None, new: float | None, name: str = "peak_moment") -> str:
    found = judge(measured(**{name: old}), measured(**{name: new})).findings
    return found[1].verdict


@pytest.fixture(scope="module")
def mutated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Verdicts, Path]:
    """Scenarios in a baseline, then each changed in one thing and checked again, in parallel."""
    folder = tmp_path_factory.mktemp("mutations")
    files = {name: folder / f"{name}.toml" for name in MUTATIONS}
    files["untouched"].write_text(SHORT.format(name="untouched"))
    baseline = folder / "baseline.json"
    first = check([str(files["untouched"])], baseline, update=True, workers=1)
    assert {finding.verdict for finding in first.findings} == {"new"}
    assert first.failures == []
    # The others are the same run under other names.
    entry = read_baseline(baseline).scenarios["untouched"]
    entries = {name: msgspec.structs.replace(entry, source=f"{name}.toml") for name in files}
    write_baseline(Baseline(scenarios=entries), baseline)
    for name, file in files.items():
        file.write_text(SHORT.format(name=name) + MUTATIONS[name])
    return check((), baseline, workers=2), baseline


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in MUTATIONS if name != "untouched"])
def test_a_small_change_is_caught_and_named(name: str, mutated: tuple[Verdicts, Path]) -> None:
    failures = [f for f in mutated[0].failures if f.scenario == name]
    moments = [f for f in failures if f.metric.startswith("peak_moment_by_piece")]
    # Golden: 0.37 % (a tap), 0.75 % (a cycle), 2.6 % (b), 3.9 % (E) of the worst piece's peak.
    assert moments
    for finding in moments:
        sentence = check_report.sentence(finding)
        assert f"{name}: {finding.metric} " in sentence
        assert f"at {finding.place.time_s:.3f} s, bend" in sentence if finding.place else False
        assert "N m" in sentence
        assert "allowed 0.2 %" in sentence


def test_what_was_not_touched_passes(mutated: tuple[Verdicts, Path]) -> None:
    untouched = [f for f in mutated[0].findings if f.scenario == "untouched"]
    assert {finding.verdict for finding in untouched} == {"ok"}
    assert mutated[0].notes["untouched"] == []


def test_notes_tell_scenario_and_model_apart(mutated: tuple[Verdicts, Path]) -> None:
    """Exact: each names its file's own key and the name, by which the copies differ."""
    notes = mutated[0].notes
    assert notes["modulus"] == [
        'scenario change: name "untouched" → "modulus", sheet.young_pa none → 73.815e9',
        "model change: the compiled model is not the baseline's",
    ]
    assert notes["delay"] == [
        'scenario change: name "untouched" → "delay", robot.alter.delay_cycles 2 → 3'
    ]
    assert notes["damping"] == [
        "scenario change: compliance.rotation.b 0.5 → 0.525, compliance.x.b 7.0 → 7.35, "
        'name "untouched" → "damping"'
    ]


def test_results_do_not_depend_on_the_process(mutated: tuple[Verdicts, Path]) -> None:
    """Here, with as many threads as there are, and there, in one of two processes with one."""
    file = mutated[1].parent / "untouched.toml"
    here = measure(str(file))
    again = updated(read_baseline(mutated[1]), [here], mutated[1])
    assert again == read_baseline(mutated[1])  # exact, to the nine digits that are kept


def test_an_update_takes_the_change_in_and_keeps_edited_tolerances(
    mutated: tuple[Verdicts, Path],
) -> None:
    file = mutated[1].parent / "delay.toml"
    baseline = read_baseline(mutated[1])
    old = baseline.scenarios["delay"]
    edited = Tolerance(kind="relative", size=0.5, reason="edited")
    gates = dict(old.metrics)
    gates["rms_moment"] = msgspec.structs.replace(gates["rms_moment"], tolerance=edited)
    entries = {**baseline.scenarios, "delay": msgspec.structs.replace(old, metrics=gates)}
    new = updated(Baseline(scenarios=entries), [measure(str(file))], mutated[1])
    assert new.scenarios["delay"].metrics["rms_moment"].tolerance == edited
    assert new.scenarios["delay"].source == "delay.toml"
    assert new.scenarios["fir"] == baseline.scenarios["fir"]
    assert compare(new, [measure(str(file))]).failures == []


def test_a_change_of_code_alone_is_called_so(
    mutated: tuple[Verdicts, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def slower(cycles: int, size: int, shape: tuple[int, ...]) -> TransportDelay:
        return TransportDelay(cycles + 1, size, shape)

    monkeypatch.setattr("dualbend.control.controller.TransportDelay", slower)
    found = compare(read_baseline(mutated[1]), [measure(str(mutated[1].parent / "untouched.toml"))])
    assert "peak_moment_by_piece[3]" in {finding.metric for finding in found.failures}
    assert {finding.cause for finding in found.failures} == {"change of code, same engine"}
    assert found.notes["untouched"] == []


def test_worse_better_and_within() -> None:
    # Analytic: 0.2 % is allowed.
    assert verdict(1.0, 1.0019) == verdict(1.0, 0.9981) == verdict(None, None) == "ok"
    assert verdict(1.0, 1.0021) == "worse"
    assert verdict(1.0, 0.9979) == "better"
    assert verdict(1.0, None) == verdict(None, 1.0) == "changed"
    assert verdict(4.0, 3.0, "holes_seated") == "worse"
    assert verdict(3.0, 4.0, "holes_seated") == "better"
    assert verdict(9.0, 8.0, "simulated_time") == "changed"


def test_an_improvement_fails_too() -> None:
    found = judge(measured(peak_moment=1.0), measured(peak_moment=0.5))
    assert [finding.verdict for finding in found.failures] == ["better"]
    assert "better: 1 → 0.5 N m (-50 %, allowed 0.2 %) at 1.500 s, bend" in check_report.sentence(
        found.failures[0]
    )


def test_each_piece_is_gated_by_itself() -> None:
    old = measured(peak_moment_by_piece=[1.0, 2.0, 3.0])
    new = measured(peak_moment_by_piece=[1.0, 2.1, None])
    found = {f.metric: f.verdict for f in judge(old, new).findings[1:]}
    assert found == {
        "peak_moment_by_piece[0]": "ok",
        "peak_moment_by_piece[1]": "worse",
        "peak_moment_by_piece[2]": "changed",
    }
    shorter = judge(old, measured(peak_moment_by_piece=[1.0]))
    assert [f.metric[-3:] for f in shorter.failures] == ["[1]", "[2]"]


def test_a_metric_that_is_gone_fails_and_a_new_one_is_said() -> None:
    found = judge(measured(peak_moment=1.0), measured(rms_moment=1.0))
    assert [(f.metric, f.verdict) for f in found.findings[1:]] == [
        ("peak_moment", "changed"),
        ("rms_moment", "new"),
    ]


def test_a_metric_of_kind_none_is_read_and_not_gated() -> None:
    baseline = baseline_of(measured(peak_moment=1.0))
    one = baseline.scenarios["x"]
    ungated = Tolerance(kind="none", reason="chance")
    gate = msgspec.structs.replace(one.metrics["peak_moment"], tolerance=ungated)
    entry = msgspec.structs.replace(one, metrics={"peak_moment": gate})
    found = compare(Baseline(scenarios={"x": entry}), [measured(peak_moment=9.0)])
    assert [f.verdict for f in found.findings] == ["ok", "not gated"]


def test_another_outcome_fails_with_its_reason() -> None:
    ended = msgspec.structs.replace(
        measured(), outcome="failed", reason="it snapped", end=Place(time_s=3.0, phase="bend")
    )
    (failure,) = judge(measured(), ended).failures
    assert check_report.sentence(failure) == (
        "x: outcome changed: completed → failed (allowed the same) at 3.000 s, bend; it snapped; "
        "change of code, same engine"
    )


def test_a_change_of_engine_is_told_apart_from_one_of_code() -> None:
    old, moved = measured(peak_moment=1.0), measured(peak_moment=2.0)
    engine = msgspec.structs.replace(moved, versions={**VERSIONS, "mujoco": "4.1.0"})
    found = judge(old, engine)
    (note,) = found.notes["x"]
    assert note.startswith("engine change: mujoco 4.0.0 → 4.1.0; update the engine and")
    assert found.failures[0].cause == note
    library = msgspec.structs.replace(moved, versions={**VERSIONS, "numpy": "2.5.0"})
    assert judge(old, library).failures[0].cause == (
        "change of code (libraries differ too: numpy 2.4.6 → 2.5.0)"
    )
    settings = {
        "seed": 1,
        "sheet": {"width_m": 0.063},
        "compliance.x": {"b": 7.0},
        "guard": {"n": 1},
    }
    other = msgspec.structs.replace(engine, versions=VERSIONS, settings=settings)
    assert judge(old, other).failures[0].cause == (
        'scenario change: compliance.x.form "printed" → none, guard.n none → 1, '
        "sheet.width_m 0.06 → 0.063"
    )


def test_a_baseline_without_settings_blames_nothing_on_them() -> None:
    old, new = baseline_of(measured(peak_moment=1.0)), measured(peak_moment=2.0)
    entry = msgspec.structs.replace(old.scenarios["x"], settings={}, scenario_sha256="0b")
    found = compare(Baseline(scenarios={"x": entry}), [new])
    assert found.failures[0].cause == (
        "change of code (or of settings, which the baseline does not hold)"
    )
    assert found.notes["x"] == ["no settings to compare: the baseline is of an earlier version"]
    # An update takes them in, and drops the hash.
    again = updated(Baseline(scenarios={"x": entry}), [new], Path("b")).scenarios["x"]
    assert (again.settings, again.scenario_sha256) == (SETTINGS, "")
    passed = compare(Baseline(scenarios={"x": again}), [new])
    assert (passed.failures, passed.notes) == ([], {"x": []})


def test_a_refusal_is_an_outcome() -> None:
    refused = measure("pwb-impossible")
    assert (refused.outcome, refused.metrics) == ("refused", {})
    assert "task.layout.holes.middle.along_m" in refused.reason
    assert compare(baseline_of(refused), [refused]).failures == []
    ran = msgspec.structs.replace(refused, outcome="completed")
    assert [f.metric for f in compare(baseline_of(ran), [refused]).failures] == ["outcome"]


def test_the_command_says_why_a_scenario_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "baseline.json"
    options = ["--baseline", str(file), "--update", "--workers", "1"]
    found = CliRunner().invoke(main, ["check", "pwb-impossible", *options])
    line = next(t for t in found.stderr.splitlines() if t.startswith("pwb-impossible: refused"))
    assert "task.layout.holes.middle.along_m" in line


def test_a_fault_of_the_program_ends_one_scenario_and_no_update_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError("of its own")

    monkeypatch.setattr("dualbend.check.measure.make_run", fails)
    crashed = measure("fig6")
    assert (crashed.outcome, crashed.reason) == ("crashed", "ZeroDivisionError: of its own")
    (failure,) = judge(measured(), msgspec.structs.replace(crashed, name="x")).failures
    assert "ZeroDivisionError: of its own" in check_report.sentence(failure)
    monkeypatch.setattr("dualbend.check.check.measure_all", lambda *_: [crashed])
    file = tmp_path / "baseline.json"
    with pytest.raises(InputError, match=r"not written: fig6 .* crashed"):
        check(["fig6"], file, update=True)
    assert not file.exists()


def test_every_peak_is_found_in_its_row() -> None:
    settings = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")
    result = BendingRun(load_scenario(STRIP9, settings)).run()
    metrics = result.metrics
    places = peak_places(result, metrics)
    pieces = places.pop("peak_moment_by_piece")
    assert len(pieces) == 2
    assert None not in pieces
    assert [name for name, (place,) in places.items() if place is None] in ([], [_NO_TURN])
    (place,) = places["peak_moment"]
    assert place in pieces  # exact: the largest of the pieces' peaks
    assert place is not None
    row = np.flatnonzero(result.trace["time"] == place.time_s)
    # Exact: the very number.
    assert abs(result.trace["left_true_moment_y"][row]) == metrics["peak_moment"].value
    assert place.phase == "bend"


def test_misaligned_grips_have_peaks_out_of_the_plane() -> None:
    brief = ("path.end_rad=0.2", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.3")
    plane = ("path.end_rad=0.1", "motion.speed_rad_per_s=0.8", "motion.hold_s=0.03")
    columns = {
        "peak_lateral_force": ("force_y", "N"),
        "peak_twist_moment": ("moment_x", "N m"),
        "peak_yaw_moment": ("moment_z", "N m"),
    }
    assert not columns.keys() & BendingRun(load_scenario(STRIP6, plane)).run().metrics.keys()
    rolled = [*brief, "task.misalignment.right.roll_rad=0.02"]
    result = BendingRun(load_scenario(STRIP6, rolled)).run()
    metrics, bent = result.metrics, bending_rows(result)
    places = peak_places(result, metrics)
    for name, (column, unit) in columns.items():
        peak = np.abs(result.trace[f"left_true_{column}"][bent]).max()
        assert (metrics[name].value, metrics[name].unit) == (peak, unit)  # exact
        (place,) = places[name]
        assert place is not None
        assert place.phase == "bend"
        assert default_tolerance(name, peak, "bending").size == 5e-3
        assert better_where(name, "bending") == "lower"
    # Analytic, GJ φ/L, of the flat rod without weight between ideal grips; 2 % off are found.
    sheet = result.scenario.sheet.sheet()
    flat = result.trace["left_true_moment_x"][np.flatnonzero(bent)[0]]
    assert abs(flat) == pytest.approx(
        sheet.torsional_stiffness_nm2 / sheet.length_m * 0.02, rel=0.05
    )


def test_the_peaks_of_an_assembly_are_found(tmp_path: Path) -> None:
    # The jaws have no time to come to rest, so the program gives up in its second phase.
    one = measure(str(_assembly(tmp_path)))
    assert one.outcome == "aborted"
    assert one.end is not None
    for name in ("peak_moment", "peak_force", "peak_surface_strain", "ik_residual_max"):
        (place,) = one.places[name]
        assert place is not None
        assert 0.0 <= place.time_s <= one.end.time_s
    assert one.places["peak_pin_force"] == [None]  # nothing touches a pin before


def _assembly(folder: Path) -> Path:
    path = folder / "stopped.toml"
    path.write_text('extends = "pwb"\nname = "stopped"\n[task]\ntimeout_s = 0.1\n')
    return path


def test_a_models_fingerprint_is_of_its_numbers_and_not_of_their_last_digits() -> None:
    def of(change: float) -> str:
        settings = [f"sheet.young_pa={70.3e9 * (1.0 + change)!r}"]
        return model_fingerprint(make_run(load_scenario("fig6", settings)).cell.model)

    assert of(0.0) == of(1e-14)  # analytic: seven digits count
    assert of(0.0) != of(1e-5)


def test_what_cannot_be_checked_is_bad_input(tmp_path: Path) -> None:
    file = tmp_path / "baseline.json"
    write_baseline(Baseline(), file)
    with pytest.raises(InputError, match="no baseline of pwb-impossible; add it: dualbend check"):
        check(["pwb-impossible"], file, workers=1)
    with pytest.raises(InputError, match="holds no scenario"):
        check((), file)
    with pytest.raises(InputError, match="fig88"):
        measure_all(["fig88"])
    mine = tmp_path / "mine.toml"
    mine.write_text('extends = "fig8"\nname = "fig6"\n')
    with pytest.raises(InputError, match=r"fig6 and .*mine\.toml are both named 'fig6'"):
        measure_all(["fig6", str(mine)])


def _verdicts() -> Verdicts:
    old = measured(peak_moment=1.0, rms_moment=1.0)
    new = msgspec.structs.replace(
        measured(peak_moment=2.0, rms_moment=1.0, oscillation=0.1), model_sha256="n"
    )
    return judge(old, new)


def test_junit_counts_what_it_holds(tmp_path: Path) -> None:
    check_report.write_junit(_verdicts(), tmp_path / "j.xml")
    root = ElementTree.parse(tmp_path / "j.xml").getroot()
    (suite,) = root
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases] == [
        *("outcome", "oscillation", "peak_moment", "rms_moment")
    ]
    counts = {key: suite.get(key) for key in ("tests", "failures", "skipped", "errors")}
    assert counts == {"tests": "4", "failures": "1", "skipped": "1", "errors": "0"}
    failure = cases[2].find("failure")
    assert failure is not None
    assert "peak_moment worse: 1 → 2 N m (+100 %" in str(failure.get("message"))
    assert "model change" in str(suite.findtext("system-out"))
    assert root.get("failures") == "1"


def test_markdown_shows_failures_first(tmp_path: Path) -> None:
    check_report.write_markdown(_verdicts(), tmp_path / "m.md")
    text = (tmp_path / "m.md").read_text()
    assert text.startswith("## dualbend check: failed")
    assert text.index("WORSE") < text.index("<details>") < text.index("| x | rms_moment |")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {10}
    # A failure is a row before the fold and one in it.
    assert text.count("| peak_moment |") == 2 and "peak_moment worse" not in text
    assert "* x: change of code (the model too)" in text


@pytest.mark.parametrize("write", [check_report.write_junit, check_report.write_markdown])
def test_a_report_that_cannot_be_written_is_bad_input(
    write: Callable[[Verdicts, Path], None],
) -> None:
    with pytest.raises(InputError, match="/proc/none/r: cannot be written"):
        write(_verdicts(), Path("/proc/none/r"))


def test_the_conclusion_counts() -> None:
    assert check_report.conclusion(_verdicts()) == (
        "2 of 3 values of 1 scenario are the baseline's; 1 are new: --update takes them in; "
        "1 are not: where that is meant, --update"
    )
    assert check_report.table(_verdicts(), everything=False).count("\n") == 1


@pytest.mark.slow
def test_the_command_says_each_failure_and_the_setting_once(tmp_path: Path) -> None:
    """A setting changed after the baseline: each row and the key with both values, once."""
    file, baseline = tmp_path / "mine.toml", tmp_path / "b.json"
    file.write_text(SHORT.format(name="mine"))
    options = ["--baseline", str(baseline), "--workers", "1"]
    assert CliRunner().invoke(main, ["check", str(file), *options, "--update"]).exit_code == 0
    passed = CliRunner().invoke(main, ["check", *options])
    assert passed.exit_code == 0 and passed.stdout.count("\n") == 1
    file.write_text(SHORT.format(name="mine") + "[sheet]\nwidth_m = 0.06\n")
    failed = CliRunner().invoke(main, ["check", *options])
    assert failed.exit_code == 1
    lines = failed.stdout.splitlines()
    assert sum("peak_moment " in line for line in lines) == 1
    (row,) = [line for line in lines if "peak_moment " in line]
    assert row.split()[-4:][0] == "at" and row.endswith("s, bend")
    assert [line for line in lines if "width_m" in line] == [
        "mine: scenario change: sheet.width_m 0.057 → 0.06"
    ]


def test_what_is_true_of_all_scenarios_is_said_once_and_without_names() -> None:
    old = {n: msgspec.structs.replace(measured(peak_moment=1.0), name=n) for n in ("x", "y")}
    baseline = updated(Baseline(), list(old.values()), Path("b"))
    later = {**SETTINGS, "guard": {"n": 1}}
    new = [msgspec.structs.replace(one, settings=later) for one in old.values()]
    assert check_report.explanations(compare(baseline, new)) == [
        "scenario change: guard.n none → 1"
    ]
    new[1] = msgspec.structs.replace(new[1], outcome="failed", reason="it snapped")
    assert check_report.explanations(compare(baseline, new)) == [
        "scenario change: guard.n none → 1",
        "y: failed: it snapped",
    ]


def test_the_settings_are_all_that_a_scenario_asks_for() -> None:
    """Exact: resolved, the defaults too, as JSON gives them back; the description says nothing."""
    scenario = load_scenario("pwb-misaligned", ["description=other"])
    settings = settings_of(scenario)
    assert settings == settings_of(load_scenario("pwb-misaligned"))
    assert settings == json.loads(json.dumps(settings))
    assert settings["seed"] == 1 and settings["task"]["kind"] == "assembly"
    assert settings["task.errors"]["pickup_x_m"] == 1e-3
    assert settings["compliance"]["sensing"] == ["left", "right"]
    assert "young_pa" not in settings["sheet"]  # not set
    deep = settings_of(load_scenario("pwb-misaligned", ["task.layout.holes.clearance_m=3e-4"]))
    assert changed_settings(settings, deep) == ["task.layout.holes.clearance_m 0.0002 → 0.0003"]
    off = settings_of(load_scenario("pwb-misaligned", ["task.compliance=none"]))
    assert all(
        "task.compliance." in line and line.endswith("→ none")
        for line in changed_settings(settings, off)
    )


def test_a_change_of_nothing_has_no_percentage() -> None:
    finding = Finding(
        scenario="x", metric="m", unit="N", old=0.0, new=1.0, allowed="0.5 N", reason="r",
        verdict="worse",
    )  # fmt: skip
    assert finding.change is None
    assert check_report.sentence(finding) == "x: m worse: 0 → 1 N (allowed 0.5 N)"
