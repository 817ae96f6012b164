"""Sensors and links of single worlds, joined: each world keeps its numbers to the last bit."""

from typing import Any

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.filters import FirConfig, IirConfig, LowPass, LowPassConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.control.guard import ProtectiveStop
from dualbend.control.worlds import BLOCK, drawn
from dualbend.control.wrist import WristSensors
from dualbend.imperfection.draws import ahead, noise_streams
from dualbend.imperfection.link import CommandLink, LinkConfig, losses, no_command
from dualbend.imperfection.sensor import ErringSensor, SensorErrors, dropouts
from dualbend.types import SIDES, Vector

CYCLES = 100
WORLDS: list[dict[str, Any]] = [
    {"force_drift_spread_n_per_h": 50.0, "torque_walk_nm": 1.0, "zeroed_before_s": 600.0},
    {"dropout_probability": 0.2, "dropout_cycles": 3, "scale_ratio": 1.1},
    {"dropout_probability": 0.1, "spike_probability": 0.3, "spike_force_n": 9.0},
    {"stuck": ("right",), "stuck_from_s": 0.28, "stuck_for_s": 0.5, "cross_talk_spread": 0.01},
    {},
    {"spike_probability": 0.1, "spike_torque_nm": 0.4, "force_walk_n": 3.0, "scale_spread": 0.02},
]
LINKS: list[dict[str, Any]] = [
    {"lost_probability": 0.1, "burst_cycles": 3.0, "policy": "hold"},
    {"lost_probability": 0.2, "doubled_probability": 0.2, "policy": "extrapolate"},
    {"jitter_s": 0.05, "late_probability": 0.2, "doubled_probability": 0.1},
    {"jitter_s": 0.3, "lost_probability": 0.05, "slack_s": 0.0, "policy": "extrapolate"},
    {"late_probability": 0.3, "policy": "stop"},
    {"lost_probability": 0.3, "stop_cycles": 4},
]


def wrists(
    seed: int, erring: bool = True, low_pass: LowPassConfig | None = None, **sensor: Any
) -> WristSensors:
    """Return a world's wrist sensors; its numbers are its seed's own."""
    config = ForceTorqueConfig(
        **{"force_noise_n": 0.05 * (seed % 3), "lever_arm_m": 0.1 + 0.01 * seed, **sensor}
    )
    noise, arms = noise_streams(seed, 2), [(seed, side) for side in SIDES]
    period_s = COMMAND_PERIOD_S
    cut_off = low_pass or IirConfig(cutoff_hz=8.0 + seed)
    return WristSensors(
        WrenchChain(
            ErringSensor(config, noise, SensorErrors(**WORLDS[seed]), arms, (2,), period_s=period_s)
            if erring
            else Sensor(config, noise, (2,)),
            ToolGravityCompensation([1.0 + 0.1 * seed, 1.2], [[0.01 * seed, 0.0, 0.05]] * 2),
            LowPass(cut_off, period_s=period_s, shape=(2,)),
            np.eye(3),
        ),
        (0, 1),
    )


def told(sensors: WristSensors, wrench: Vector, turns: Vector) -> tuple[Vector, ...]:
    read = sensors.read(wrench, turns)
    return read.sensor.components, read.grips.components[0], read.filtered.components, read.fresh


@pytest.mark.parametrize("erring", [True, False])
def test_wrist_sensors_of_many_worlds_are_those_of_each(erring: bool) -> None:
    """Exact: other seeds, noise, levers, tools, cut-offs and errors in each."""
    count = len(WORLDS)
    rng = np.random.default_rng(0)
    loads = rng.normal(size=(CYCLES, count, 2, 6)) * np.repeat([40.0, 3.0], 3)
    turns = np.linalg.qr(rng.normal(size=(count, 2, 3, 3)))[0]
    alone = [wrists(seed, erring) for seed in range(count)]
    many = WristSensors.stacked([wrists(seed, erring) for seed in range(count)])
    arrived = []
    for load in loads:
        together = told(many, load, turns)
        for world, one in enumerate(alone):
            for whole, part in zip(together, told(one, load[world], turns[world]), strict=True):
                np.testing.assert_array_equal(whole[world], part)
        arrived.append(together[3])
    lost = ~np.array(arrived).all(axis=(0, 2))
    assert lost.tolist() == ([False, True, True, True, False, False] if erring else [False] * 6)


def link(seed: int, **keys: Any) -> CommandLink:
    config = LinkConfig(**{"stop_cycles": 1_000_000, **LINKS[seed], **keys})
    return CommandLink(
        config, seed, SIDES, (2, 3), np.arange(5.0) + seed, period_s=COMMAND_PERIOD_S
    )


def test_links_of_many_worlds_are_those_of_each() -> None:
    """Exact: what is executed, its age, and who stops after how many cycles, in other words too."""
    count = len(LINKS)
    alone = [link(seed) for seed in range(count)]
    many = CommandLink.stacked([link(seed) for seed in range(count)])
    stopped = set()
    for setpoint in np.random.default_rng(0).normal(size=(CYCLES, count, 5)):
        executed = many.forward(setpoint)
        for world, one in enumerate(alone):
            if world in stopped:
                continue
            starved = many.starved[world]
            try:
                np.testing.assert_array_equal(one.deliver(setpoint[world]), executed[world])
                assert not starved.any()
            except ProtectiveStop as stop:
                stopped.add(world)
                arm = int(np.argmax(starved > 0))
                assert str(no_command(SIDES[arm], starved[arm])) == str(stop)
                assert stop.sides == SIDES[arm : arm + 1]
            assert one.age.tolist() == many.age[world].tolist()
    assert stopped == {4, 5}
    assert many.age[:4].shape == (4, 2)


@pytest.mark.parametrize(
    ("another", "words"),
    [
        (wrists(1, erring=False), "Sensor and ErringSensor cannot be one"),
        (wrists(1, low_pass=FirConfig(taps=5)), r"LowPass.* is of shape \(5,\) and \(3,\)"),
        (wrists(1, force_resolution_n=0.0), "ErringSensor._rounded is"),
    ],
    ids=["class", "taps", "rounding"],
)
def test_worlds_that_cannot_be_one_say_why(another: WristSensors, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        WristSensors.stacked([wrists(0), another])


@pytest.mark.parametrize("kind", ["standard_normal", "random"])
def test_what_is_drawn_ahead_is_what_single_draws_give(kind: str) -> None:
    """Exact: two blocks; an element that needs none is 0."""
    ahead_of_all, one_by_one = (getattr(np.random.default_rng(7), kind) for _ in range(2))
    draws = [ahead(ahead_of_all, 6), ahead(ahead_of_all, 6, when=0.0)]
    found = np.concatenate([drawn(draws, (1, 2), 6) for _ in range(2)])
    np.testing.assert_array_equal(found[:, 0, 0], [one_by_one(6) for _ in range(2 * BLOCK)])
    assert not found[:, 0, 1].any()


@pytest.mark.parametrize("p", [5e-4, 0.1, 0.9])
def test_bursts_drawn_ahead_are_those_of_single_draws(p: float) -> None:
    """Exact: 40 blocks; a burst draws its length, a drop-out of three cycles a number in each."""
    ahead_of_all, one, other = (np.random.default_rng(7) for _ in range(3))
    lost, missing = [], []
    while len(lost) < 40 * BLOCK:
        begins = one.random() < p
        lost += [begins] * (one.geometric(0.25) if begins else 1)
    while len(missing) < 40 * BLOCK:
        begins = other.random() < p
        missing += [begins] * (3 if begins else 1)
        other.random(2 * begins)
    for draw, wanted in (
        (losses(ahead_of_all, p, 4.0), lost),
        (dropouts(np.random.default_rng(7), p, 3), missing),
    ):
        found = np.concatenate([draw() for _ in range(40)])
        np.testing.assert_array_equal(found, wanted[: 40 * BLOCK])
