"""The command line before any work: what help, list and completion load, and what they show.

Loaded modules are asserted, not times: exact, and the same on every machine.
"""

import json
import os
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import dualbend.cli
from dualbend.cli import main
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scenario.shipped import complete_scenario

COMMANDS = sorted(main.commands)
LIGHT = {"dualbend", "dualbend.errors", "dualbend.files", "dualbend.interrupts", "dualbend.cli"} | {
    f"dualbend.cli.{module.name}" for module in pkgutil.iter_modules(dualbend.cli.__path__)
}
FOLDER = {"dualbend.resources", "dualbend.scenario", "dualbend.scenario.shipped"}
PROBE = """
import json, sys
before = set(sys.modules)
from dualbend.cli import main
try:
    main(json.loads(sys.argv[1]), prog_name="dualbend")
except SystemExit as end:
    assert not end.code, end.code
print("LOADED", json.dumps(sorted(set(sys.modules) - before)))
"""


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments))


def loaded(arguments: list[str], **environment: str) -> tuple[set[str], str]:
    """Return the modules outside the standard library that a command loads, and its output."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE, json.dumps(arguments)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    output, _, names = done.stdout.rpartition("LOADED ")
    return {
        name
        for name in json.loads(names)
        if name.partition(".")[0] not in sys.stdlib_module_names | {"click", "colorama"}
    }, output


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["list", "--help"]], ids=str)
def test_help_loads_nothing_but_click(arguments: list[str]) -> None:
    modules, output = loaded(arguments)
    assert modules == LIGHT
    assert "Usage" in output


@pytest.mark.parametrize("arguments", [["list"], ["run"]], ids=str)
def test_listing_loads_no_more_than_the_folder(arguments: list[str]) -> None:
    modules, output = loaded(arguments)
    assert modules == LIGHT | FOLDER
    for name in list_scenarios():
        assert re.search(rf"^{re.escape(name)} +{re.escape(load_scenario(name).description)}$",
                         output, re.MULTILINE)  # fmt: skip


def test_a_tab_completes_scenarios_and_loads_no_more_than_the_folder() -> None:
    modules, output = loaded(
        [], _DUALBEND_COMPLETE="bash_complete", COMP_WORDS="dualbend run fi", COMP_CWORD="2"
    )
    assert modules == LIGHT | FOLDER
    assert output.split() == ["plain,fig6", "plain,fig8", "plain,fig9"]


def test_what_is_no_scenario_completes_as_a_file() -> None:
    assert [item.value for item in complete_scenario("pwb-t")] == ["pwb-tight"]
    for text in ("mine", "./fig", "runs/"):
        assert [(item.value, item.type) for item in complete_scenario(text)] == [(text, "file")]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_an_example_that_it_understands(name: str) -> None:
    """Each line is as typed, not filled into a paragraph, and the command parses it."""
    output = call(name, "--help").output
    assert "Example:" in output
    lines = re.findall(r"^ +(dualbend .*)$", output.partition("Example:")[2], re.MULTILINE)
    own = [
        line for line in lines if line.startswith(f"dualbend {name} ") or line.split()[1:] == [name]
    ]
    assert own
    for line in lines:
        _, command, *arguments = shlex.split(line)
        main.commands[command].make_context(command, arguments).close()


def test_the_commands_summaries_are_whole() -> None:
    """Click ends a summary that is too long with dots; here each fits in its line."""
    assert "..." not in call("--help").output.partition("Commands:")[2].partition("Example")[0]


def test_options_without_a_scenario_are_an_error() -> None:
    """An unset variable in a script must not pass: nothing ran."""
    result = call("run", "--seed", "3")
    assert result.exit_code == 2
    assert "fig8" in result.output


@pytest.mark.parametrize("command", ["schema", "reference"])
def test_generated_texts_are_printed_or_written(command: str, tmp_path: Path) -> None:
    path = tmp_path / "made"
    assert call(command, "--out", str(path)).exit_code == 0
    assert path.read_text(encoding="utf-8") == call(command).output
    assert call(command, "--out", str(tmp_path / "none" / "made")).exit_code == 2


def test_new_writes_once_and_runs_as_its_base(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("new", "mine", "--from", "fig8").exit_code == 0
    text = Path("mine.toml").read_text(encoding="utf-8")
    again = call("new", "mine")
    assert again.exit_code == 2
    assert "exists" in again.output
    assert Path("mine.toml").read_text(encoding="utf-8") == text
    assert load_scenario("mine.toml").compliance == load_scenario("fig8").compliance


def test_every_option_of_a_command_says_what_it_does() -> None:
    for name, command in main.commands.items():
        for option in command.params:
            assert not isinstance(option, click.Option) or option.help, f"{name}: {option.name}"


def test_the_package_run_as_a_module_is_the_command_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "dualbend", "--help"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("Usage: python -m dualbend")
