"""Which run a file is of: written in three places, read back from each, and never mixed."""

from __future__ import annotations

import msgspec
import pytest

from dualbend.errors import InputError
from dualbend.run import identity
from dualbend.run.identity import RunIdentity
from dualbend.scenario.load import load_scenario, parse_scenario

SCENARIO = load_scenario("fig8", seed=7)
ONE = RunIdentity.of(SCENARIO, 32 * "a")
OTHER = RunIdentity.of(load_scenario("fig6", seed=8), 32 * "b")


def test_each_place_gives_the_same_identity_back() -> None:
    text = ONE.to_toml(SCENARIO.to_toml())
    assert identity.identity_of_toml(text) == ONE
    assert parse_scenario(text, "scenario.toml") == SCENARIO
    assert identity.identity_of_metadata(ONE.to_metadata()) == ONE
    assert msgspec.json.decode(msgspec.json.encode(ONE), type=RunIdentity) == ONE


def test_files_that_name_no_run_are_of_a_version_that_did_not() -> None:
    assert identity.identity_of_toml(SCENARIO.to_toml()) is None
    assert identity.identity_of_metadata({"seed": "7"}) is None
    assert identity.one_identity({"scenario.toml": None, "summary.json": None}) is None


def test_a_scenario_that_was_changed_after_its_run_is_refused() -> None:
    text = ONE.to_toml(SCENARIO.to_toml()).replace("seed = 7", "seed = 8")
    with pytest.raises(InputError, match="changed after the run"):
        identity.identity_of_toml(text)


@pytest.mark.parametrize(
    "text", ["# run\n", "# run a, seed 7, scenario sha256 b\n", "# run {id}, seed -1\n"]
)
def test_a_garbled_comment_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="line 1"):
        identity.identity_of_toml(text)


def test_garbled_metadata_are_refused() -> None:
    with pytest.raises(InputError, match=r"metadata name no run.*seed"):
        identity.identity_of_metadata({**ONE.to_metadata(), "seed": "7.5"})


def test_two_runs_are_refused_with_both_names() -> None:
    assert identity.one_identity({"a": ONE, "b": ONE}) == ONE
    with pytest.raises(InputError, match=f"a of run {ONE.id}.*b of run {OTHER.id}"):
        identity.one_identity({"a": ONE, "b": OTHER})
    with pytest.raises(InputError, match=f"a of run {ONE.id}.*b of a run that it does not name"):
        identity.one_identity({"a": ONE, "b": None})
