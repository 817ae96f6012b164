"""Presets of imperfections: what is not given, and what stands before it."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.imperfection import config
from dualbend.imperfection.config import PRESETS, ImperfectionsConfig, PresetName, with_preset
from dualbend.imperfection.draws import stream
from dualbend.run.disk.output import model_hash
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario, parse_scenario
from support.short_bend import SHORT


def numbers_of(preset: str, *settings: str) -> dict[str, Any]:
    scenario = load_scenario("fig6", [f"imperfections={preset}", *settings])
    numbers: dict[str, Any] = msgspec.to_builtins(scenario.imperfections)
    return numbers


def test_none_is_what_every_key_has_by_default() -> None:
    assert numbers_of("none") == msgspec.to_builtins(ImperfectionsConfig())


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_holds_its_numbers_and_survives_being_written(name: PresetName) -> None:
    scenario = load_scenario("fig6", [f"imperfections={name}"])
    held = msgspec.to_builtins(scenario.imperfections)
    assert held["preset"] == name
    for numbers in PRESETS[name].values():
        for section, values in numbers.items():
            assert held[section] | values == held[section]
    assert parse_scenario(scenario.to_toml(), "again") == scenario


def test_a_key_stands_before_the_preset_and_a_preset_before_the_keys_of_the_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = {"one": {"robot": {"a": 1.0, "b": 2.0}}, "two": {"link": {"c": 3.0}}}
    monkeypatch.setattr(config, "PRESETS", {"none": {}, "typical": made})
    given = {"preset": "typical", "robot": {"b": 5.0}}
    assert with_preset(given) == {
        "preset": "typical",
        "robot": {"a": 1.0, "b": 5.0},
        "link": {"c": 3.0},
    }
    assert with_preset({"robot": {"b": 5.0}}) == {"robot": {"b": 5.0}}


def test_a_preset_that_is_none_is_named_with_the_choices() -> None:
    with pytest.raises(InputError, match=r"imperfections\.preset = 'bad': must be one of 'none'"):
        load_scenario("fig6", ["imperfections=bad"])


def test_streams_are_seeded_and_independent() -> None:
    first, again = (stream(3, "robot", "left").standard_normal(4) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    others = [stream(4, "robot", "left"), stream(3, "robot", "right"), stream(3, "link", "left")]
    for other in others:
        assert not np.any(first == other.standard_normal(4))


def test_another_sheet_of_a_series_has_the_same_cell_and_its_own_noise() -> None:
    settings = ["imperfections=typical", *SHORT]
    first, again, other = (
        make_run(load_scenario("learned", [*settings, f"repeat={n}"])) for n in (0, 0, 1)
    )
    # The compiled model holds arms, bases, tools and sheet as they are.
    assert model_hash(first.cell.model) == model_hash(other.cell.model)
    reading = "left_filtered_moment_y"
    one, same, another = (run.run()[reading] for run in (first, again, other))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, another)
