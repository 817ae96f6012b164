"""The sweep's file and the runs that it fixes: laws of the samples, and messages."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_1samp, norm, qmc

from dualbend.errors import InputError
from dualbend.scenario.keys import sections
from dualbend.scenario.load import load_scenario
from dualbend.study.sweep.design import Design, make_design, saltelli
from dualbend.study.sweep.file import SCENARIO, SWEEP, Sweep, load_sweep
from dualbend.study.sweep.keys import (
    _WORDS,
    Normal,
    Range,
    Uniform,
    Values,
    drawn,
    known_keys,
    make_spec,
)

UNIT = st.floats(0.0, 1.0, exclude_max=True)
BOUND = st.floats(1e-6, 1e6)


def write(folder: Path, **said: Any) -> Path:
    path = folder / "gains.toml"
    path.write_text(tomli_w.dumps({"scenario": "fig8", **said}), encoding="utf-8")
    return path


def load(folder: Path, **said: Any) -> tuple[Sweep, Design]:
    sweep = load_sweep(write(folder, **said))
    return sweep, make_design(sweep)


# -- laws of the samples -------------------------------------------------------------------------


@given(low=BOUND, ratio=st.floats(1.001, 1e3), steps=st.integers(2, 50), log=st.booleans())
def test_a_range_rises_from_its_least_to_its_most(
    low: float, ratio: float, steps: int, log: bool
) -> None:
    """Analytic: both ends exactly, strictly rising, equal steps or ratios to rounding."""
    levels = Range(min=low, max=low * ratio, steps=steps, log=log).levels()
    assert (levels[0], levels[-1], len(levels)) == (low, low * ratio, steps)
    apart = np.diff(np.log(levels) if log else levels)
    assert (apart > 0.0).all()
    assert apart == pytest.approx(apart[0], rel=1e-6)


@given(
    u=st.lists(UNIT, min_size=1, max_size=30),
    low=BOUND,
    ratio=st.floats(1.001, 1e3),
    kind=st.sampled_from(["uniform", "loguniform", "normal"]),
)
def test_a_distribution_keeps_its_bounds_and_rises(
    u: list[float], low: float, ratio: float, kind: str
) -> None:
    """Analytic: an inverse distribution function rises with u and stays within min and max."""
    table: dict[str, Any] = {"distribution": kind, "min": low, "max": low * ratio}
    if kind == "normal":
        table |= {"mean": low, "std": low}
    values = drawn(make_spec(table, "file", "key"), np.sort(np.array(u)))
    assert all(low <= value <= low * ratio for value in values)
    assert values == sorted(values)


@given(u=st.lists(UNIT, min_size=1, max_size=30), n=st.integers(1, 9))
def test_values_are_drawn_with_equal_chances(u: list[float], n: int) -> None:
    """Analytic: value k of n belongs to u in [k/n, (k+1)/n)."""
    got = drawn(Values(values=tuple(range(n))), np.array(u))
    assert got == [min(int(x * n), n - 1) for x in u]


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_a_normal_distribution_without_limits_is_finite_everywhere(end: float) -> None:
    """Analytic: 0 and 1, which a sample may hold, are as far out as a double can tell."""
    value = drawn(Normal(distribution="normal", mean=0.0, std=1.0), np.array([end]))[0]
    assert math.isfinite(value)
    assert abs(value) > 8.0


@settings(max_examples=25)
@given(sizes=st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_a_grid_has_the_product_of_its_keys_without_repetition(sizes: list[int]) -> None:
    """Analytic: every combination once, the last key fastest."""
    names = ["robot.alter.delay_cycles", "filter.taps", "seed"][: len(sizes)]
    sweep = in_memory("grid", {n: {"values": list(range(1, k + 1))} for n, k in zip(names, sizes)})  # noqa: B905
    rows = make_design(sweep).rows
    assert len(rows) == len(set(rows)) == math.prod(sizes)
    assert rows == sorted(rows)


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**40),
    n=st.sampled_from([1, 2, 8]),
    kind=st.sampled_from(["random", "sobol"]),
)
def test_one_seed_makes_one_sample(seed: int, n: int, kind: str) -> None:
    """Analytic: the same file, the same runs; a run's noise does not depend on the others."""
    keys = {
        "sheet.young_pa": {"distribution": "uniform", "min": 1e9, "max": 2e9},
        "robot.alter.delay_cycles": {"min": 0, "max": 3, "steps": 4},
    }
    sample = {"n": n, "seed": seed, "noise": "each"}
    first, again = (make_design(in_memory(kind, keys, **sample)) for _ in range(2))
    assert first == again
    assert len(first.rows) == len(first.seeds) == n
    assert all(1e9 <= young <= 2e9 and delay in range(4) for young, delay in first.rows)
    assert all(type(delay) is int for _, delay in first.rows)
    more = make_design(in_memory(kind, keys, **{**sample, "n": 16}))
    assert more.seeds[:n] == first.seeds
    if n > 1:
        assert make_design(in_memory(kind, keys, **{**sample, "seed": seed + 1})) != first


def in_memory(kind: str, keys: dict[str, Any], **sample: Any) -> Sweep:
    """Return a sweep without a file: hypothesis has no folder for each example."""
    import msgspec

    from dualbend.study.sweep.file import SweepConfig

    config = msgspec.convert(
        {"scenario": "fig8", "sample": {"kind": kind, **sample}, "keys": keys}, SweepConfig
    )
    specs = {name: make_spec(table, "file", name) for name, table in keys.items()}
    return Sweep(name="s", source="file", config=config, tables={}, settings=(), keys=specs)


def test_random_samples_have_the_distributions_asked_for(tmp_path: Path) -> None:
    """Statistical, n = 2000: Kolmogorov and Smirnov's p is above 1e-3 for these seeds."""
    keys = {
        "sheet.young_pa": {"distribution": "normal", "mean": 70e9, "std": 2e9},
        "sheet.density_kg_per_m3": {"distribution": "loguniform", "min": 100.0, "max": 10000.0},
    }
    _, design = load(tmp_path, sample={"kind": "random", "n": 2000, "seed": 4}, keys=keys)
    young, density = np.array(design.rows).T
    assert ks_1samp(young, norm(70e9, 2e9).cdf).pvalue > 1e-3
    assert ks_1samp(np.log10(density), lambda x: (x - 2.0) / 2.0).pvalue > 1e-3


def test_a_sobol_sample_fills_space_better_than_a_random_one(tmp_path: Path) -> None:
    """Analytic: each half of each key holds half of the points; discrepancy below random's."""
    keys = {
        name: {"distribution": "uniform", "min": 1.0, "max": 2.0}
        for name in ("sheet.young_pa", "sheet.density_kg_per_m3")
    }
    points = {
        kind: np.array(load(tmp_path, sample={"kind": kind, "n": 64}, keys=keys)[1].rows) - 1.0
        for kind in ("sobol", "random")
    }
    assert ((points["sobol"] < 0.5).sum(axis=0) == 32).all()
    assert qmc.discrepancy(points["sobol"]) < 0.5 * qmc.discrepancy(points["random"])


@given(n=st.integers(1, 5), d=st.integers(1, 5), seed=st.integers(0, 99))
def test_the_crossed_samples_take_one_key_of_the_other(n: int, d: int, seed: int) -> None:
    """Analytic: AB_i differs from A in column i alone, where it is B's."""
    a, b = np.random.default_rng(seed).random((2, n, d))
    rows = saltelli(a, b).reshape(d + 2, n, d)
    assert (rows[0] == a).all()
    assert (rows[1] == b).all()
    for i in range(d):
        assert (np.flatnonzero((rows[2 + i] != a).any(axis=0)) == [i]).all()
        assert (rows[2 + i][:, i] == b[:, i]).all()


# -- the file ------------------------------------------------------------------------------------

GRID = {"kind": "grid"}
DELAY = {"robot": {"alter": {"delay_cycles": {"values": [1, 2]}}}}


def test_dots_in_and_out_of_quotes_are_the_same(tmp_path: Path) -> None:
    plain = load(tmp_path, sample=GRID, keys=DELAY)[1]
    assert (
        plain
        == load(tmp_path, sample=GRID, keys={"robot.alter.delay_cycles": {"values": [1, 2]}})[1]
    )
    assert plain.names == ("robot.alter.delay_cycles",)
    assert plain.settings(1) == ("robot.alter.delay_cycles=2",)


def test_no_key_of_a_scenario_is_a_word_of_the_sweep() -> None:
    """Else a section that holds keys could not be told from what a key does."""
    names = {key.name for section in sections() for key in section.keys}
    names |= {name for section in sections() for name in section.path}
    assert not names & _WORDS


def test_a_list_goes_through_its_columns_together(tmp_path: Path) -> None:
    keys = {
        "sheet.young_pa": {"values": [60e9, 70e9, 80e9]},
        "robot.alter.delay_cycles": {"min": 1, "max": 3, "steps": 3},
        "compliance.predictor": {"values": ["none", {}, {"lead_x_s": 0.01}]},
    }
    sweep, design = load(
        tmp_path, sample={"kind": "list"}, keys=keys, set={"compliance.kind": "model"}
    )
    assert [row[:2] for row in design.rows] == [(60e9, 1), (70e9, 2), (80e9, 3)]
    found = [sweep.resolve(design.settings(i)).compliance.predictor for i in range(3)]
    assert found[0] is None
    assert found[1] is not None
    assert found[2] is not None
    assert (found[1].lead_x_s, found[2].lead_x_s) == (None, 0.01)


def test_a_run_is_what_dualbend_run_makes_of_its_settings(tmp_path: Path) -> None:
    """Analytic: the scenario of --set and --seed."""
    keys = {"sheet.young_pa": {"distribution": "uniform", "min": 6e10, "max": 7e10}}
    fixed = {"motion": {"speed_rad_per_s": 0.5}, "path.end_rad": 0.4}
    sample = {"kind": "random", "n": 3, "noise": "each"}
    sweep, design = load(tmp_path, sample=sample, keys=keys, set=fixed)
    given_settings = ("motion.speed_rad_per_s=0.5", "path.end_rad=0.4", *design.settings(2))
    assert sweep.resolve(design.settings(2), design.seed(2)) == load_scenario(
        "fig8", given_settings, design.seed(2)
    )


def test_what_is_set_of_an_arm_s_stand_survives_its_arm(tmp_path: Path) -> None:
    """Analytic: in whichever order the file has them, with dots or as tables."""
    dotted = {"cell.base_distance_m": 1.02, "robot.model": "ur5"}
    tables = {"cell": {"base_distance_m": 1.02}, "robot": {"model": "ur5"}}
    for fixed in (dotted, tables):
        sweep, _ = load(tmp_path, sample=GRID, keys=DELAY, set=fixed)
        scenario = sweep.resolve()
        assert (scenario.cell.base_distance_m, scenario.robot.model) == (1.02, "ur5")


def test_the_folder_s_own_files_are_the_same_sweep(tmp_path: Path) -> None:
    """Analytic: also of a scenario that lies beside the file and extends another."""
    (tmp_path / "mine.toml").write_text(
        'extends = "fig6"\nname = "mine"\n[robot.alter]\nmode = "tool"\n'
    )
    keys = {"sheet.young_pa": {"distribution": "normal", "mean": 7e10, "std": 1e9, "min": 6e10}}
    said = {"scenario": "mine.toml", "sample": {"kind": "sobol", "n": 4}, "keys": keys}
    sweep, design = load(tmp_path, **said, metrics=["peak_force"], set={"seed": 5})
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / SWEEP).write_text(sweep.to_toml())
    (folder / SCENARIO).write_text(sweep.scenario_toml())
    again = load_sweep(folder)
    assert again.to_toml() == sweep.to_toml()
    assert again.name == "gains"
    assert make_design(again) == design
    assert again.resolve() == sweep.resolve()
    assert again.resolve().seed == 5


NORMAL = {"distribution": "normal", "mean": 1.0, "std": 0.1}


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (
            {"sample": GRID, "keys": {"sheet.yuong_pa": {"values": [1.0]}}},
            r"s\.toml: keys\.sheet\.yuong_pa: no key of a scenario; did you mean sheet\.young_pa",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"values": ["soft"]}}},
            r"keys\.sheet\.young_pa: 'soft' in values: must be number",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"min": 2.0, "max": 1.0, "steps": 3}}},
            r"keys\.sheet\.young_pa: max = 1\.0 must be above min = 2\.0",
        ),
        (
            {
                "sample": GRID,
                "keys": {"sheet.young_pa": {"min": 0.0, "max": 1.0, "steps": 3, "log": True}},
            },
            r"min = 0\.0 must be above 0: it has no logarithm",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"min": 0.0, "max": 1.0}}},
            r"keys\.sheet\.young_pa = .*needs values = .* or min, max, steps",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"min": "a", "max": 1.0, "steps": 3}}},
            r"keys\.sheet\.young_pa\.min = 'a': must be a number",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"values": [1.0], "stpes": 3}}},
            r"keys\.sheet\.young_pa\.stpes = 3: unknown key",
        ),
        ({"sample": GRID, "keys": {"sheet.young_pa": 3.0}}, r"keys\.sheet\.young_pa = 3\.0: needs"),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": NORMAL}},
            r'a distribution is for sample\.kind = "random" or "sobol", not "grid"',
        ),
        (
            {"sample": {"kind": "random", "n": 4}, "keys": {"robot.alter.delay_cycles": NORMAL}},
            r"keys\.robot\.alter\.delay_cycles: is a whole number: give values",
        ),
        (
            {
                "sample": GRID,
                "keys": {"robot.alter.delay_cycles": {"min": 0, "max": 1, "steps": 3}},
            },
            r"keys\.robot\.alter\.delay_cycles: is a whole number, and the range has 0\.5",
        ),
        (
            {"sample": GRID, "keys": {"robot.alter.mode": {"values": ["word"]}}},
            r"'word' in values: must be",
        ),
        (
            {"sample": GRID, "keys": {"robot.alter.mode": {"min": 0, "max": 1, "steps": 2}}},
            "not a number",
        ),
        ({"sample": GRID, "keys": {"sheet": {"min": 0, "max": 1, "steps": 2}}}, "is a section"),
        ({"sample": GRID, "keys": {}}, r"\[keys\] is empty"),
        ({"sample": GRID, "keys": DELAY, "set": ["seed=2"]}, r"set = .*: must be a section$"),
        (
            {"sample": GRID, "keys": {"sheet.young_pa": {"values": 1e9}}},
            r"keys\.sheet\.young_pa\.values = 1000000000\.0: must be a list of values, 1 to 100",
        ),
        (
            {"sample": GRID, "keys": {"sheet.young_pa" * 9**3: {"values": [1.0]}}},
            r"keys\.sheet\.young_pa.{0,90}: no key of a scenario",
        ),
        (
            {"sample": GRID, "keys": DELAY, "set": {"robot.alter.delay_cycles": 1}},
            "is given as well",
        ),
        (
            {"sample": GRID, "keys": DELAY, "set": {"robot": {"alter": {"delay": 1}}}},
            r"\[set\]: fig8: robot\.alter\.delay = 1: unknown key; did you mean delay_cycles",
        ),
        (
            {"sample": {"kind": "sobol", "n": 100}, "keys": DELAY},
            r"sample: n = 100 is no power of two.* 64 or 128",
        ),
        ({"sample": {"kind": "random"}, "keys": DELAY}, 'sample: kind = "random" needs n'),
        ({"sample": {"kind": "grid", "n": 3}, "keys": DELAY}, "not n"),
        (
            {"sample": {"kind": "gird"}, "keys": DELAY},
            "sample.kind = 'gird': must be one of 'grid'",
        ),
        ({"sample": {"kind": "grid", "sensitivity": True}, "keys": DELAY}, 'needs kind = "sobol"'),
        ({"scenario": "fig88", "sample": GRID, "keys": DELAY}, "did you mean 'fig8'"),
        ({"sample": GRID, "keys": DELAY, "sed": 1}, "sed = 1: unknown key; did you mean set"),
        ({"sample": GRID, "keys": {"seed": {"values": [1, 1]}}}, "keys.seed: values has 1 twice"),
        (
            {"sample": {"kind": "list"}, "keys": {**DELAY, "seed": {"values": [1]}}},
            r"as many values each: robot\.alter\.delay_cycles 2, seed 1",
        ),
        (
            {
                "sample": GRID,
                "keys": {
                    n: {"min": 1, "max": 2, "steps": 1000}
                    for n in ("sheet.young_pa", "sheet.length_m")
                },
            },
            "1000000 runs; the most are 100000",
        ),
        (
            {
                "sample": {"kind": "random", "n": 2, "noise": "each"},
                "keys": {"seed": {"values": [1]}},
            },
            "gives it as well",
        ),
        ({"sample": GRID, "keys": {"sheet.young_pa": {"values": [math.nan]}}}, "finite number"),
    ],
)
def test_what_cannot_be_used_is_said(said: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        load(tmp_path, **said)


def test_a_file_that_is_none_is_said(tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text("[")
    for name, message in (("broken.toml", "no valid TOML"), ("none.toml", "no sweep's file")):
        with pytest.raises(InputError, match=message):
            load_sweep(tmp_path / name)


def test_every_key_of_a_scenario_is_known() -> None:
    """Analytic: as many as the sections have."""
    names = {".".join((*section.path, key.name)) for section in sections() for key in section.keys}
    assert {name for name, key in known_keys().items() if key is not None} == names
    assert isinstance(make_spec({"distribution": "uniform", "min": 0, "max": 1}, "f", "k"), Uniform)
