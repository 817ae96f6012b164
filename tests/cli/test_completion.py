"""What a tab offers behind ``--set``: the keys of a scenario and what each may be."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import CompletionItem, ShellComplete, get_completion_class

from dualbend.arm.catalog import JOINT_COUNT
from dualbend.beam.material import library
from dualbend.cli import main
from dualbend.cli.completion import complete_materials, complete_settings
from dualbend.scenario.keys import sections
from dualbend.scenario.load import load_scenario
from dualbend.scenario.structs import has_kinds

STARTED = "from dualbend.cli import main; main(prog_name='dualbend')"


def offered(incomplete: str, *words: str) -> list[CompletionItem]:
    """Return what click offers for an incomplete word after ``dualbend run fig8 --set``."""
    shell = ShellComplete(main, {}, "dualbend", "_DUALBEND_COMPLETE")
    return shell.get_completions(["run", "fig8", *words, "--set"], incomplete)


def texts(incomplete: str) -> list[str]:
    return [item.value for item in offered(incomplete)]


def test_every_key_of_a_scenario_is_reached_from_tab_to_tab() -> None:
    wanted = {
        ".".join((*section.path, key.name)) + "="
        for section in sections()
        for key in section.keys
        if key.name != "kind"
    }
    found, left = set[str](), [""]
    while left:
        items = texts(left.pop())
        found |= {item for item in items if item.endswith("=")}
        left += [item for item in items if item.endswith(".")]
    assert wanted <= found
    # What is besides is a section that a value can stand for: its kind, a preset, none.
    sections_alone = {".".join(section.path) + "=" for section in sections()}
    kinds = {item for item in found if item.endswith("kind=")}
    assert found - wanted - kinds <= sections_alone


@pytest.mark.parametrize(
    ("incomplete", "expected"),
    [
        ("sheet.th", ["sheet.thickness_m="]),
        ("sh", ["sheet."]),
        ("robot.serv", ["robot.servo."]),
        ("compliance.rot", ["compliance.rotation.", "compliance.rotation="]),
        ("imperf", ["imperfections.", "imperfections="]),
        ("imperfections=t", ["imperfections=typical"]),
        ("imperfections=", [f"imperfections={p}" for p in ("none", "typical", "worst")]),
        ("sheet.plastic=", ["sheet.plastic=true", "sheet.plastic=false"]),
        ("sheet.rigidity=p", ["sheet.rigidity=plate"]),
        ("sheet.model=s", ["sheet.model=strips", "sheet.model=shell"]),
        ("sheet.material=FR-4-", ["sheet.material=FR-4-crosswise"]),
        ("robot.model=pu", ["robot.model=puma560"]),
        ("robot.left.model=ur1", ["robot.left.model=ur10"]),
        ("filter=", ["filter=fir", "filter=iir", "filter=none"]),
        ("sheet.thickness_m=", ["sheet.thickness_m=none"]),
        ("seed=", []),
        ("sheet.nothing=", []),
        ("nothing.", []),
        ("extends", []),
    ],
)
def test_keys_and_values_go_on_as_they_may(incomplete: str, expected: list[str]) -> None:
    assert texts(incomplete) == expected


def test_every_offered_value_is_one_that_loads() -> None:
    for key in ("sheet.plastic", "sheet.rigidity", "sheet.material", "filter", "imperfections"):
        values = [text for text in texts(f"{key}=") if not text.endswith("material=none")]
        assert len(values) > 1
        for value in values:
            load_scenario("fig8", [value, "sheet.yield_pa=1e8"])


def test_keys_are_explained_and_every_command_with_settings_completes_them() -> None:
    (item,) = offered("sheet.th")
    assert "twentieth" in str(item.help)
    having = [c for c in main.commands.values() if any(p.name == "settings" for p in c.params)]
    assert len(having) > 8
    for command in having:
        (option,) = (p for p in command.params if p.name == "settings")
        found = option.shell_complete(click.Context(command), "seed")
        assert [item.value for item in found] == ["seed="]


def test_a_file_may_stand_where_no_name_begins_so() -> None:
    for text in ("path.learned=lear", "sheet.material=mine/", "robot.model=mine/"):
        (item,) = offered(text)
        assert (item.value, item.type) == (text.partition("=")[2], "file")


def test_every_arm_is_offered_and_none_loads_the_physics() -> None:
    offered_arms = [text.partition("=")[2] for text in texts("robot.model=")]
    assert sorted(offered_arms) == sorted(JOINT_COUNT)
    code = """
import sys
from click.shell_completion import ShellComplete
from dualbend.cli import main
shell = ShellComplete(main, {}, "dualbend", "_DUALBEND_COMPLETE")
for text in ("robot.model=", "sheet.material=", "sheet.", "path.learned="):
    assert shell.get_completions(["run", "fig8", "--set"], text), text
print([m for m in ("mujoco", "numpy", "scipy", "msgspec") if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_materials_are_completed_by_name() -> None:
    context, option = click.Context(main), click.Option(["--x"])
    every = complete_materials(context, option, "")
    assert [item.value for item in every] == list(library())


def test_an_installation_without_its_files_offers_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from dualbend.cli import completion

    monkeypatch.setattr(completion, "files", lambda _: tmp_path)
    completion._schema.cache_clear()
    try:
        assert complete_settings(click.Context(main), click.Option(["--x"]), "sh") == []
    finally:
        completion._schema.cache_clear()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sheet.rigidity", "=", "pl"], ["plate"]),
        (["sheet.plastic", "="], ["true", "false"]),
        (["sheet.rigidity=pl"], ["sheet.rigidity=plate"]),  # of who took = out of its breaks
        (["sheet.th"], ["sheet.thickness_m="]),
        (["sheet.model", "=", "st"], ["strips"]),
    ],
)
def test_bash_which_splits_at_the_sign_gets_what_replaces_its_last_word(
    words: list[str], expected: list[str], tmp_path: Path
) -> None:
    if shutil.which("bash") is None:
        pytest.skip("no bash here")
    kind = get_completion_class("bash")
    assert kind is not None
    source = kind(main, {}, "dualbend", "_DUALBEND_COMPLETE").source()
    typed = ["dualbend", "run", "fig8", "--set", *words]
    quoted = " ".join(f"'{word}'" for word in typed)
    # A command on the path, as the shell finds it.
    command = tmp_path / "dualbend"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{STARTED}"\n', encoding="utf-8")
    command.chmod(0o755)
    script = f"""{source}
compopt() {{ echo "compopt=$2"; }}
COMP_WORDS=({quoted}) COMP_CWORD={len(typed) - 1}
_dualbend_completion dualbend
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    environment = os.environ | {
        "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    arguments = ["bash", "--norc", "-c", script]
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert [line for line in lines if not line.startswith("compopt")] == expected
    # No space after what goes on.
    assert ("compopt=nospace" in done.stdout) == expected[0].endswith(("=", "."))


def test_sections_of_kinds_offer_the_keys_of_every_kind() -> None:
    for section in sections():
        if has_kinds({section.kind: section.struct}):
            names = {t.rstrip("=.").rpartition(".")[2] for t in texts(".".join(section.path) + ".")}
            assert {key.name for key in section.keys} <= names
