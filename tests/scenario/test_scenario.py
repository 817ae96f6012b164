"""The scenario file: what is shipped loads; what is wrong is refused, by key and value."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dualbend.errors import InputError
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scenario.motion import nominal_motion
from dualbend.scenario.path import ExactPathConfig
from dualbend.scenario.scenario import Scenario

SHIPPED = sorted(list_scenarios())
BASE = """
name = "base"
description = "of the base"
[sheet]
length_m = 0.4
width_m = 0.06
thickness_m = 0.0005
young_pa = 70e9
poisson_ratio = 0.33
density_kg_per_m3 = 2700
[path]
kind = "piecewise"
interval_rad = 0.2
[filter]
kind = "fir"
cutoff_hz = 5.0
taps = 4
[compliance]
x = { b = 7.0, k = 575.0 }
"""

Write = Callable[..., str]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_file(text: str | bytes, name: str = "case.toml") -> str:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    write_file(BASE, "base.toml")
    return write_file


def refused(*args: Any, **kwargs: Any) -> str:
    """Load, expect an InputError and nothing else, and return its message."""
    with pytest.raises(InputError) as caught:
        load_scenario(*args, **kwargs)
    message = str(caught.value)
    assert "\n" not in message.strip()
    return message


# --- what is right ------------------------------------------------------------------------------


def test_there_are_scenarios() -> None:
    assert {"fig6", "fig8", "fig9", "exact"} <= set(SHIPPED)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scenario_loads_and_says_who_it_is(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert (
        nominal_motion(
            scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
        ).cycles
        > 10
    )


@pytest.mark.parametrize("name", SHIPPED)
def test_a_resolved_scenario_is_equal_when_loaded_again(name: str, write: Write) -> None:
    scenario = load_scenario(name)
    again = load_scenario(write(scenario.to_toml()))
    assert again == scenario
    assert again.to_toml() == scenario.to_toml()


def test_settings_and_seed_survive_the_round_trip(write: Write) -> None:
    scenario = load_scenario("fig8", ["compliance.complying=[]", "sensor.latency_ms=0.1"], seed=12)
    assert load_scenario(write(scenario.to_toml())) == scenario
    assert scenario.seed == 12
    assert scenario.compliance.complying == ()


def test_extends_lays_the_file_over_its_base(write: Write) -> None:
    scenario = load_scenario(
        write('extends = "base.toml"\nname = "c"\n[path]\nend_rad = 0.6\n[compliance.x]\nb = 3.0')
    )
    assert scenario.path.end_rad == 0.6
    assert scenario.path.interval_rad == 0.2
    assert scenario.compliance.x is not None
    assert (scenario.compliance.x.b, scenario.compliance.x.k) == (3.0, 575.0)


def test_a_description_is_not_inherited(write: Write) -> None:
    assert load_scenario(write('extends = "base.toml"\nname = "c"')).description == ""


def test_extends_finds_shipped_scenarios_and_chains(write: Write) -> None:
    write('extends = "fig8"\nname = "middle"\n[motion]\nhold_s = 2.0', "middle.toml")
    scenario = load_scenario(write('extends = "middle.toml"\nname = "top"'))
    assert scenario.motion.hold_s == 2.0
    assert scenario.compliance == load_scenario("fig8").compliance


def test_another_kind_replaces_the_whole_section(write: Write) -> None:
    scenario = load_scenario(
        write('extends = "base.toml"\nname = "c"\n[path]\nkind = "exact"\nend_rad = 0.7')
    )
    assert scenario.path == ExactPathConfig(end_rad=0.7)


def test_the_same_kind_keeps_the_section(write: Write) -> None:
    scenario = load_scenario(write('extends = "base.toml"\nname="c"\n[filter]\nkind="fir"\ntaps=2'))
    assert (scenario.filter.taps, scenario.filter.cutoff_hz) == (2, 5.0)


def test_naming_the_default_kind_keeps_the_section(write: Write) -> None:
    """A base that leaves kind at its default has that kind."""
    write(BASE.replace('kind = "fir"\n', ""), "plain.toml")
    scenario = load_scenario(write('extends = "plain.toml"\nname = "c"\n[filter]\nkind = "fir"'))
    assert (scenario.filter.taps, scenario.filter.cutoff_hz) == (4, 5.0)


@pytest.mark.parametrize(
    ("setting", "read", "value"),
    [
        ("robot.alter.delay_cycles=3", lambda s: s.robot.alter.delay_cycles, 3),
        (" motion.speed_rad_per_s = 0.2 ", lambda s: s.motion.speed_rad_per_s, 0.2),
        ('path.kind="piecewise"', lambda s: s.path.kind, "piecewise"),
        ("robot.alter.mode=tool-frozen", lambda s: s.robot.alter.mode, "tool-frozen"),
        ("name=a", lambda s: s.name, "a"),
        ("description=a = b", lambda s: s.description, "a = b"),
        ("compliance.tare=true", lambda s: s.compliance.tare, True),
        ('compliance.sensing=["left","right"]', lambda s: s.compliance.sensing, ("left", "right")),
        ("compliance.x.b=3", lambda s: s.compliance.x.b, 3.0),
        ("compliance.rotation={b=1,k=2}", lambda s: s.compliance.rotation.k, 2.0),
    ],
)
def test_a_setting_reaches_its_key(
    setting: str, read: Callable[[Scenario], object], value: object, write: Write
) -> None:
    assert read(load_scenario(write(BASE), [setting])) == value


def test_the_last_setting_wins() -> None:
    scenario = load_scenario("fig6", ["motion.hold_s=2", "motion.hold_s=3"])
    assert scenario.motion.hold_s == 3.0


@pytest.mark.parametrize(
    ("inline", "by_key"),
    [
        (
            ["cell={base_distance_m=0.9}", 'robot={model="ur5"}'],
            ["cell.base_distance_m=0.9", "robot.model=ur5"],
        ),
        (
            ["sheet={young_pa=6e10}", 'sheet={material="spring-steel"}'],
            ["sheet.young_pa=6e10", "sheet.material=spring-steel"],
        ),
        (
            ["filter={taps=3}", 'filter={"kind"="fir", cutoff_hz=4}'],
            ["filter.taps=3", "filter.kind=fir", "filter.cutoff_hz=4"],
        ),
        # What is no kind, material or arm keeps its place: the last one wins.
        (
            ["sheet.young_pa=6e10", 'sheet={material="spring-steel", young_pa=5e10}'],
            ["sheet.material=spring-steel", "sheet.young_pa=5e10"],
        ),
    ],
)
def test_settings_in_a_table_are_those_of_its_keys(inline: list[str], by_key: list[str]) -> None:
    scenario = load_scenario("fig6", inline)
    assert scenario == load_scenario("fig6", by_key)
    assert scenario == load_scenario("fig6", by_key[::-1])


def test_a_table_that_contradicts_itself_is_refused() -> None:
    said = refused("fig6", ["path={interval_rad=0.1, pieces=5}"])
    assert 'path.pieces = 5: belongs to kind = "pieces", this path is "piecewise"' in said


def test_seed_on_the_command_line_wins_over_the_file(write: Write) -> None:
    assert load_scenario(write("seed = 4\n" + BASE), seed=9).seed == 9


# --- what is wrong ------------------------------------------------------------------------------

WRONG_SETTINGS = [
    # key misspelt, unknown, of another unit
    ("sheet.thicknes_m=0.001", "sheet.thicknes_m", "0.001", "thickness_m"),
    ("sheet.length_mm=400", "sheet.length_mm", "400", "length_m"),
    ("pth.end_rad=1", "pth", "", "path"),
    ("compliance.x.damping=1", "compliance.x.damping", "1", "form"),
    ("sheet.model.hinge=4", "sheet.model.hinge", "4", "hinges"),
    ("extends=fig8", "extends", "fig8", "unknown"),
    # values out of range, or in another unit
    ("sheet.thickness_m=0.5", "sheet.thickness_m", "0.5", "0.01"),
    ("sheet.length_m=400", "sheet.length_m", "400", "a number ≥ 0.05, ≤ 3 [m]"),
    ("sheet.young_pa=70", "sheet.young_pa", "70", "≥ 100e6, ≤ 1e12 [Pa]"),
    ("sheet.density_kg_per_m3=2.7", "sheet.density_kg_per_m3", "2.7", "100"),
    ("sheet.poisson_ratio=0.5", "sheet.poisson_ratio", "0.5", "0.5"),
    ("sheet.thickness_m=-0.0005", "sheet.thickness_m", "-0.0005", ""),
    ("sheet.width_m=0.005", "thickness_m", "0.0005", "thin"),
    ("motion.speed_rad_per_s=-0.1", "motion.speed_rad_per_s", "-0.1", ""),
    ("motion.speed_rad_per_s=0", "motion.speed_rad_per_s", "0", ""),
    ("motion.settle_s=1e9", "motion.settle_s", "1000000000", "600"),
    ("motion.speed_rad_per_s=1e-9", "motion.speed_rad_per_s", "1e-09", "3600"),
    ("motion.acceleration_rad_per_s2=0", "motion.acceleration_rad_per_s2", "0", ""),
    ("seed=-1", "seed", "-1", "0"),
    ("robot.alter.delay_cycles=-1", "robot.alter.delay_cycles", "-1", "0"),
    ("robot.alter.delay_cycles=1000", "robot.alter.delay_cycles", "1000", "100"),
    ("guard.torque_cycles=0", "guard.torque_cycles", "0", "1"),
    ("guard.sensor_cycles=0", "guard.sensor_cycles", "0", "1"),
    ("guard.speed_fraction=1.5", "guard.speed_fraction", "1.5", "1"),
    ("cell.base_distance_m=-0.1", "cell.base_distance_m", "-0.1", "≥ 0"),
    ("compliance.limit_x_m=0", "compliance.limit_x_m", "0", ""),
    ("compliance.x.k=0", "compliance.x.k", "0", ""),
    ("filter.taps=0", "filter.taps", "0", "1"),
    ("filter.cutoff_hz=18", "cutoff_hz", "18", "17.857"),
    ("sensor.force_range_n=0.01", "force_range_n", "0.01", "0.05"),
    ("sensor.latency_ms=1e5", "sensor.latency_ms", "100000", "1000"),
    ("path.end_rad=2.5", "end_rad", "2.5", "2.28"),
    ("path.start_rad=1.5", "start_rad", "1.5", "end_rad"),
    ("path.interval_rad=0", "path.interval_rad", "0", ""),
    ("sheet.model.hinges=21", "hinges", "21", "even"),
    ("sheet.model.hinges=2", "sheet.model.hinges", "2", "4"),
    ("robot.servo.stiffness_n_m_per_rad=[1,2,3]", "robot.servo.stiffness_n_m_per_rad", "3", "6"),
    (
        "robot.servo.stiffness_n_m_per_rad=[1,2,3,4,5,-6]",
        "robot.servo.stiffness_n_m_per_rad",
        "-6",
        "",
    ),
    ("physics.step_s=0.003", "step_s", "0.003", "0.0028"),
    ("physics.step_s=0.056", "physics.step_s", "0.056", "0.05"),
    # no numbers
    ("path.end_rad=nan", "path.end_rad", "nan", "finite"),
    ("path.end_rad=inf", "path.end_rad", "inf", "finite"),
    ("sensor.force_bias_n=[0,-inf,0]", "sensor.force_bias_n", "inf", "finite"),
    ("path.end_rad=1e400", "path.end_rad", "inf", "finite"),
    # sizes that overflow a product on the way
    (
        "robot.response.natural_frequency_hz=1e300",
        "robot.response.natural_frequency_hz",
        "1e+300",
        "",
    ),
    ("sensor.force_resolution_n=1e-320", "sensor.force_resolution_n", "1e-320", ""),
    ("sensor.force_range_n=1e308", "sensor.force_range_n", "1e+308", ""),
    ("sensor.force_noise_n=1e308", "sensor.force_noise_n", "1e+308", ""),
    # another type
    ("path.end_rad=0.5 rad", "path.end_rad", "0.5 rad", "must be a number"),
    ('path.end_rad="0.5"', "path.end_rad", "0.5", "must be a number"),
    ("path.end_rad=true", "path.end_rad", "True", "must be a number"),
    (
        "robot.alter.delay_cycles=true",
        "robot.alter.delay_cycles",
        "True",
        "must be a whole number ≥ 0, ≤ 100",
    ),
    ("seed=1.5", "seed", "1.5", "must be a whole number"),
    ("compliance.tare=1", "compliance.tare", "1", "must be true or false"),
    ("name=5", "name", "5", "must be a text, 1 to 100 characters"),
    ("path.end_rad=[1]", "path.end_rad", "1", "must be a number"),
    ("path.end_rad=2020-01-01", "path.end_rad", "2020", "must be a number"),
    ("path=3", "path", "3", "must be a section"),
    ("sheet.model=20", "sheet.model", "20", "must be a section"),
    (
        "compliance.sensing=left",
        "compliance.sensing",
        "left",
        'must be a list of "left" or "right", 1 to 2 entries, such as ["left"]',
    ),
    ("path.end_rad=", "path.end_rad", "", "must be a number"),
    # choices
    ("path.kind=exakt", "path.kind", "exakt", "exact"),
    ("filter.kind=butter", "filter.kind", "butter", "iir"),
    ("robot.alter.mode=base", "robot.alter.mode", "base", "world"),
    ("compliance.units=SI", "compliance.units", "SI", "si"),
    ('compliance.sensing=["both"]', "compliance.sensing", "both", "left"),
    ('expect.outcome=["done"]', "expect.outcome", "done", "completed"),
    ('compliance.sensing=["left","left"]', "sensing", "left", "twice"),
    ("compliance.sensing=[]", "compliance.sensing", "[]", "1"),
    ("expect.outcome=[]", "expect.outcome", "[]", "1"),
    # combinations
    ('path={kind="pieces",pieces=0}', "path.pieces", "0", "1"),
    ("compliance.rotation.b=1", "compliance.rotation", "", "k"),
    # names that are no file's name
    ("name=a/b", "name", "a/b", ""),
    ("name=../up", "name", "../up", ""),
    ('name=""', "name", "", ""),
]


@pytest.mark.parametrize(
    ("setting", "key", "value", "right"), WRONG_SETTINGS, ids=[row[0] for row in WRONG_SETTINGS]
)
def test_a_wrong_value_is_refused_by_key_and_value(
    setting: str, key: str, value: str, right: str, write: Write
) -> None:
    # The base, with the file of its own, has no description that could hold the words by chance.
    message = refused(write(BASE), [setting])
    said = message.split("case.toml with --set", 1)[-1]
    for word in (key, value, right):
        assert word in said, message


@pytest.mark.parametrize(
    ("scenario", "given", "words"),
    [
        ("pwb", ["motion.return_rad=0.1"], ["motion.return_rad = 0.1", "an assembly"]),
        (
            "pwb",
            ["sheet.plastic=true", "sheet.yield_pa=3e8"],
            ["sheet.plastic = true", "an assembly"],
        ),
        ("pwb", ["sheet.model=shell"], ['sheet.model = "shell"', "an assembly"]),
        (
            "pwb",
            ["task.misalignment.left.roll_rad=0.1"],
            ["task.misalignment", 'belongs to kind = "bending"'],
        ),
        (
            "fig6",
            ["task.misalignment.left=none"],
            ["task.misalignment.left = 'none'", "along_m, lateral_m, height_m, roll_rad"],
        ),
        ("fig6", ["guard=none"], ["guard = 'none'", "always there", "following_error_rad"]),
    ],
)
def test_what_would_say_nothing_is_refused(
    scenario: str, given: list[str], words: list[str]
) -> None:
    message = refused(scenario, given)
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("setting", "word"),
    [
        ("robot.alter.delay_cycles", "path.to.key=value"),
        ("=3", "path.to.key=value"),
        ("", "path.to.key=value"),
        ("alter..delay_cycles=3", "path.to.key=value"),
        (".=3", "path.to.key=value"),
        ("sheet.length_m.x=3", "length_m"),
        ("name.first=3", "name"),
    ],
)
def test_a_setting_that_is_none_is_refused(setting: str, word: str) -> None:
    message = refused("fig6", [setting])
    assert word in message
    assert f"--set {setting}" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = ", ["case.toml", "TOML"]),
        ("[sheet\nlength_m = 1", ["case.toml", "TOML", "line 1"]),
        ('name = "a"\nname = "b"', ["case.toml", "TOML"]),
        (b"name = '\xff'", ["case.toml", "utf-8"]),
        (b"\xff\xfen\x00a\x00", ["case.toml", "utf-8"]),
        ("", ["case.toml", "name"]),
        ('name = "a"', ["case.toml", "sheet"]),
        (BASE.replace("length_m = 0.4\n", ""), ["case.toml", "sheet", "length_m"]),
        (
            BASE.replace("interval_rad = 0.2\n", ""),
            ["case.toml", "path", "`interval_rad`, as kind"],
        ),
        (BASE.replace("[sheet]", "[[sheet]]"), ["case.toml", "sheet"]),
        ('extends = "nothing"', ["nothing", "fig6"]),
        ('extends = "nothing.toml"', ["nothing.toml"]),
        ('extends = ""', ["fig6"]),
        ("extends = 3", ["case.toml", "extends", "3"]),
        ('extends = ["fig6"]', ["case.toml", "extends", "fig6"]),
        ('extends = "case.toml"', ["case.toml", "circle"]),
        ('extends = "fig6x"', ["fig6x", "fig6"]),
        ('extends = "\\u0000.toml"', ["extends"]),
        ('extends = "' + "a" * 3000 + '"', ["a" * 20]),
        ("seed = " + "9" * 5000 + BASE, ["case.toml"]),
        ("seed = " + "[" * 3000 + "]" * 3000 + BASE, ["case.toml"]),
    ],
    ids=[
        "no value",
        "broken section",
        "key twice",
        "not UTF-8",
        "UTF-16",
        "empty",
        "sections missing",
        "key missing",
        "no pieces",
        "array of tables",
        "base missing",
        "base file missing",
        "base empty",
        "base a number",
        "base a list",
        "extends itself",
        "base misspelt",
        "base with NUL",
        "base too long",
        "5000 digits",
        "3000 brackets",
    ],
)
def test_a_wrong_file_is_refused(text: str | bytes, words: list[str], write: Write) -> None:
    message = refused(write(text))
    for word in words:
        assert word in message


def test_a_circle_of_two_is_refused(write: Write) -> None:
    write('extends = "case.toml"', "other.toml")
    assert "circle" in refused(write('extends = "other.toml"'))


def test_a_wrong_value_of_a_base_names_the_key(write: Write) -> None:
    write(BASE.replace("length_m = 0.4", "length_m = 400"), "wrong.toml")
    assert "sheet.length_m = 400" in refused(write('extends = "wrong.toml"\nname = "c"'))


@pytest.mark.parametrize(
    "name", ["", "nothing", "nothing.toml", "/", ".", "a\0b", "a\0b.toml", "a" * 5000, "fig6 "]
)
def test_a_name_that_is_no_scenario_is_refused(name: str) -> None:
    refused(name)


def test_a_misspelt_name_gets_the_nearest(write: Write) -> None:
    assert "did you mean 'fig6'" in refused("figg6")
    assert "fig8" in refused("nothing")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    assert str(tmp_path) in refused(str(tmp_path))
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    assert "folder.toml" in refused(str(folder))


@pytest.mark.parametrize("seed", [-1, -(10**30)])
def test_a_negative_seed_is_refused(seed: int) -> None:
    assert f"seed = {seed}" in refused("fig6", seed=seed)


# The step and the knots of the path decide how much memory a run takes: these would need gigabytes.
@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ("physics.step_s=1e-9", "step_s"),
        ("physics.step_s=1e-300", "step_s"),
        ("path.interval_rad=1e-9", "interval_rad"),
        ("path.interval_rad=1e-300", "interval_rad"),
        ("sheet.model.hinges=1000000", "hinges"),
        ("robot.alter.delay_cycles=1000000000000", "delay_cycles"),
        ("motion.hold_s=1e9", "hold_s"),
    ],
)
def test_a_number_that_would_fill_the_memory_is_refused(setting: str, key: str) -> None:
    assert key in refused("fig6", [setting])


def test_a_path_of_too_many_pieces_is_refused(write: Write) -> None:
    text = BASE.replace("interval_rad = 0.2", "pieces = 1000000000").replace("piecewise", "pieces")
    assert "path.pieces = 1000000000" in refused(write(text))


# --- anything at all ----------------------------------------------------------------------------

RESOLVED = msgspec.to_builtins(load_scenario("fig8"))
WORDS = st.sampled_from(["exact", "piecewise", "fir", "left", "world", "printed", "si", "x", ""])
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-5, 200)
    | st.sampled_from([2**63, -(2**64), 10**30])
    | st.floats(allow_nan=True, allow_infinity=True)
    | st.floats(-2.0, 2.0)
    | WORDS
    | st.text(max_size=5)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


def paths(table: dict[str, Any], above: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = []
    for key, value in table.items():
        found.append((*above, key))
        if isinstance(value, dict):
            found += paths(value, (*above, key))
    return found


PATHS = paths(RESOLVED)


def without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [without_none(v) for v in value if v is not None]
    return value


@settings(
    max_examples=120,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    changes=st.lists(
        st.tuples(st.sampled_from(PATHS), st.sampled_from(["set", "drop", "rename"]), VALUES),
        min_size=1,
        max_size=3,
    )
)
def test_no_change_of_a_file_raises_anything_but_an_input_error(
    changes: list[tuple[tuple[str, ...], str, Any]], tmp_path: Path
) -> None:
    data = msgspec.to_builtins(load_scenario("fig8"))
    for keys, action, value in changes:
        table = data
        for key in keys[:-1]:
            table = table.get(key) if isinstance(table, dict) else None
        if not isinstance(table, dict) or keys[-1] not in table:
            continue
        if action == "set":
            table[keys[-1]] = value
        else:
            old = table.pop(keys[-1])
            if action == "rename":
                table[keys[-1][:-1] + "_"] = old
    path = tmp_path / "fuzz.toml"
    try:
        path.write_text(tomli_w.dumps(without_none(data)), encoding="utf-8")
    except UnicodeEncodeError:
        return
    try:
        scenario = load_scenario(str(path))
    except InputError as error:
        assert re.search(r"fuzz\.toml|scenario", str(error))
        return
    # What was accepted can be written and read again.
    path.write_text(scenario.to_toml(), encoding="utf-8")
    assert load_scenario(str(path)) == scenario


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    key=st.sampled_from([".".join(p) for p in PATHS]) | st.text(max_size=12),
    value=st.text(max_size=12) | SCALARS.map(str),
)
def test_no_setting_raises_anything_but_an_input_error(key: str, value: str) -> None:
    try:
        load_scenario("fig8", [f"{key}={value}"])
    except InputError as error:
        assert str(error)
