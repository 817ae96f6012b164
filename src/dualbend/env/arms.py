"""Bending with an arm an agent, for PettingZoo: each arm knows its own wrist and grip."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from dualbend.env import EXTRA
from dualbend.env.base import Info
from dualbend.env.bend import BendEnv
from dualbend.errors import InputError
from dualbend.types import SIDES, Vector

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise InputError(EXTRA) from error

_OWN = 6
"""Numbers of an observation of bending that are one arm's."""


def parallel_env(**parts: Any) -> ArmsEnv:  # noqa: ANN401 - those of BendEnv
    """Return bending with an arm an agent; ``parts`` are the arguments of :class:`BendEnv`."""
    return ArmsEnv(BendEnv(**parts))


class ArmsEnv(ParallelEnv):  # type: ignore[misc]  # it has no types
    """Agents ``left`` and ``right`` bend the sheet together, as in :class:`BendEnv`.

    Observation (8,) of an arm: what :class:`BendEnv` has of it, the nominal bending angle [rad] and
    the time [s]. Action (3,): its deviation along x and z [m] and in pitch [rad]. Reward of a step:
    −(M/``moment_scale_nm``)² of its own grip; a run that is not completed costs both.
    """

    metadata = {"name": "dualbend_arms_v1", "render_modes": []}  # noqa: RUF012 - PettingZoo's
    render_mode = None

    def __init__(self, bend: BendEnv) -> None:
        self.bend = bend
        self.possible_agents: list[str] = list(SIDES)
        self.agents: list[str] = []
        seen, done = bend.observation_space, bend.action_space
        self.observation_spaces = _boxes(_of_arms(seen.low), _of_arms(seen.high))
        self.action_spaces = _boxes(_halves(done.low), _halves(done.high))

    def observation_space(self, agent: str) -> Box[np.float64]:
        """Return the space of an arm's observation."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box[np.float64]:
        """Return the space of an arm's action."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Info | None = None
    ) -> tuple[dict[str, Vector], dict[str, Info]]:
        """Begin a run, as :meth:`BendEnv.reset` does."""
        seen, info = self.bend.reset(seed=seed, options=options)
        self.agents = list(SIDES)
        return _of_arms(seen), {side: dict(info) for side in SIDES}

    def step(
        self, actions: dict[str, Vector]
    ) -> tuple[
        dict[str, Vector], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Info]
    ]:
        """Run one command cycle with the actions of both arms."""
        seen, _, ended, _, info = self.bend.step(np.concatenate([actions[side] for side in SIDES]))
        cost = self.bend.failure_cost * (info.get("outcome", "completed") != "completed")
        rewards: dict[str, float] = {
            side: -float((moment / self.bend.moment_scale_nm) ** 2) - cost
            for side, moment in zip(SIDES, info["moment_nm"], strict=True)
        }
        if ended:
            self.agents = []
        infos: dict[str, Info] = {side: dict(info) for side in SIDES}
        ends = dict.fromkeys(self.possible_agents, ended)
        return _of_arms(seen), rewards, ends, dict.fromkeys(ends, False), infos

    def close(self) -> None:
        """End the run."""
        self.bend.close()


def _of_arms(seen: Vector) -> dict[str, Vector]:
    """Return each arm's part of an observation of bending, and what is of both."""
    both = seen[2 * _OWN :]
    return {
        side: np.concatenate([seen[i * _OWN : (i + 1) * _OWN], both])
        for i, side in enumerate(SIDES)
    }


def _halves(action: Vector) -> dict[str, Vector]:
    return dict(zip(SIDES, action.reshape(2, -1), strict=True))


def _boxes(low: dict[str, Vector], high: dict[str, Vector]) -> dict[str, Box[np.float64]]:
    return {side: Box(low[side], high[side], dtype=np.float64) for side in SIDES}
