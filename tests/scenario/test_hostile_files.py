"""Files and values that nobody means: refused in a line of bounded length, or accepted."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec import inspect as mi

from dualbend.errors import InputError, brief, shortened
from dualbend.scenario.keys import listed, sections
from dualbend.scenario.load import load_scenario
from dualbend.scenario.structs import fields_of, plain

LONGEST = 600
"""Characters of a message: a few lines of a terminal. Fixed before any case was looked at."""


def refused(path: Path | str, *settings: str) -> str:
    with pytest.raises(InputError) as caught:
        load_scenario(str(path), settings)
    message = str(caught.value)
    assert len(message) <= LONGEST
    assert "\n" not in message
    return message


def test_a_byte_order_mark_is_no_part_of_the_file(tmp_path: Path) -> None:
    """Exact: the same scenario with and without; the mark is what Windows' editors write."""
    plain_file, marked = tmp_path / "a.toml", tmp_path / "b.toml"
    plain_file.write_text('extends = "fig6"\n', encoding="utf-8")
    marked.write_text('extends = "fig6"\n', encoding="utf-8-sig")
    assert load_scenario(str(marked)) == load_scenario(str(plain_file))


@pytest.fixture
def impatient() -> Iterator[None]:
    """Fail a test that hangs."""

    def give_up(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("impatient")
def test_what_is_no_file_is_refused_without_waiting(tmp_path: Path) -> None:
    """A pipe that nobody writes to would be read for ever, a device without end."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "device.toml").symlink_to("/dev/zero")
    (tmp_path / "loop.toml").symlink_to("loop.toml")
    for name, word in (
        ("pipe.toml", "a pipe or a device"),
        ("folder.toml", "a folder"),
        ("device.toml", "a pipe or a device"),
        ("loop.toml", ""),
    ):
        assert word in refused(tmp_path / name)
        child = tmp_path / "child.toml"
        child.write_text(f'extends = "{name}"\n', encoding="utf-8")
        assert name in refused(child)
    assert "a pipe or a device" in refused("/dev/null")


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    with path.open("wb") as file:
        file.truncate(10**12)  # sparse: no memory would hold it
    assert "more than 1e+07 bytes" in refused(path)


def test_a_long_chain_of_files_is_refused(tmp_path: Path) -> None:
    for i in range(3000):
        (tmp_path / f"{i}.toml").write_text(f'extends = "{i + 1}.toml"\n', encoding="utf-8")
    assert "files extend one another" in refused(tmp_path / "0.toml")
    # A short one is what extending is for.
    (tmp_path / "5.toml").write_text('extends = "fig6"\n', encoding="utf-8")
    assert load_scenario(str(tmp_path / "0.toml")) == load_scenario("fig6", ["description="])


@pytest.mark.parametrize(
    "text",
    [
        f"[{'.'.join(['a'] * 3000)}]\nb = 1\n",
        f"{'.'.join(['a'] * 3000)} = 1\n",
        f"a = {'[' * 400}{']' * 400}\n",
        f"a = {'{b=' * 400}1{'}' * 400}\n",
    ],
    ids=["table", "dotted key", "list", "inline table"],
)
def test_tables_and_lists_without_end_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_text(f'extends = "fig6"\n{text}', encoding="utf-8")
    assert "deep" in refused(tmp_path / "deep.toml")


@pytest.mark.parametrize(
    "setting",
    [
        "description=" + "d" * 100_000,
        "sheet.width_m=" + "9" * 5000,
        "sheet.width_m=0x" + "f" * 5000,
        "x" * 100_000 + "=1",
        "x" * 100_000,
        "sheet." + "x" * 100_000 + "=1",
        "sheet.material=" + "m" * 100_000,
        "robot.model=" + "m" * 100_000,
        "path.kind=" + "m" * 100_000,
        "compliance.sensing=[" + '"left",' * 5000 + "]",
        "path.table=[" + "[0,0,0]," * 20_000 + "]",
        'path={kind="table",table=[' + "[0,0,0]," * 20_000 + "]}",
        "cell.home_rad=" + "[" * 500 + "]" * 500,
        'sheet.material="a\\nb"',
        "description=\udcff",
    ],
    ids=lambda setting: setting[:24],
)
def test_a_long_value_is_echoed_short(setting: str) -> None:
    refused("fig6", setting)


def test_a_short_value_is_echoed_whole() -> None:
    """Golden: what stands in the middle of a long one is left out, its ends stay."""
    assert brief("right") == "'right'"
    assert brief([1.5, "a"]) == "[1.5, 'a']"
    assert len(brief("a" * 1000)) <= 90
    assert brief(16**9000) == "a int too large to show"
    assert shortened("one\ntwo") == "one two"
    assert shortened("a" * 1000 + "end", 90).startswith("a" * 60)
    assert shortened("a" * 1000 + "end", 90).endswith("aend")


def unbounded(info: mi.Type) -> bool:
    """Return whether a type lets a number, a text or a list of any size through."""
    info = plain(info)[0]
    if isinstance(info, mi.FloatType | mi.IntType):
        return (info.ge, info.gt) == (None, None) or (info.le, info.lt) == (None, None)
    if isinstance(info, mi.TupleType):
        return any(map(unbounded, info.item_types))
    if isinstance(info, mi.VarTupleType):
        return info.max_length is None or unbounded(info.item_type)
    return isinstance(info, mi.StrType) and info.max_length is None


def test_every_value_of_a_scenario_has_bounds() -> None:
    """Exact: no key takes what no cell has, a lever arm of 1e9 m or a text of a megabyte."""
    free = [
        f"{section.title}.{name}"
        for section in (*sections(), *listed())
        for name, field in fields_of(section.struct).items()
        if not field.is_section and unbounded(field.type)
    ]
    assert free == []
    for setting in ("sensor.lever_arm_m=1e9", "guard.following_error_rad=1e9", "seed=1e300"):
        assert setting.partition("=")[0] in refused("fig6", setting)
