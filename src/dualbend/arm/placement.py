"""Where an arm should stand for its work: base, elbow and wrist branch, found by trial.

The best place has the largest minimum along the path of two quantities: manipulability over the
arm's largest, and joint-limit margin over half the range. Thousands of places and branches are
tried at once on a grid, the best are followed along the path, the winner is refined.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.arm.chain import serial_chain, volume
from dualbend.arm.mjcf import with_gripper
from dualbend.arm.model import ArmModel, Placement
from dualbend.errors import InputError
from dualbend.types import Vector

MIN_MARGIN_RAD: Final = np.radians(5.0)
"""Joint-limit margin that every joint must keep along the path."""

_SEED, _SEEDS, _SEEDS_OF_ONE, _KEPT, _REFINED = 11, 12, 1800, 200, 2
_SAMPLES = 6000
_REACHED = 1e-5
_DISTANCE = (0.25, 0.4, 0.5, 0.6, 0.7, 0.85)
_LATERAL = (0.0, 0.12, -0.12, 0.25, -0.25)
_HEIGHT = (-0.7, -0.45, -0.2, 0.0, 0.2)
"""The grid, over the arm's reach: base behind the flange, beside and above the grip."""

_TOOL_M, _ABOVE_FLOOR_M, _BEHIND_GRIP_M, _BESIDE_SHEET_M = 0.153, 0.06, 0.03, 0.25
_NEAREST_M, _HIGHEST_M, _CEILING_M = 0.3, 1.5, 3.0
_UPRIGHT = 0.5
"""Cosine of a base's tilt from which on it counts as standing, its negative as hanging."""

_CLIMBED, _NOT_CLEAR = 6, 10.0
"""Places to start from where none of the grid is allowed; score of what lacks more than margin."""

_STEPS, _TURN_STEP_RAD, _POSTURE_STEP_RAD, _ROUNDS = (0.08, 0.03, 0.01), np.pi / 4, 0.25, 8
_YAW = "base_yaw_rad"
COLUMN_FROM_M: Final = 0.02
"""Height [m] from which on a base stands on a column."""

COLUMN_RADIUS_M: Final = 0.07

_KEYS = ("base_distance_m", "base_lateral_m", "base_height_m", _YAW)
_TILTS = ("base_roll_rad", "base_pitch_rad")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tried:
    """Places (b, 4) as ``_KEYS``, joint angles at the targets (b, k, n), what they are worth."""

    base: Vector
    q: Vector
    score: Vector
    margin: Vector
    miss: Vector

    def __getitem__(self, which: Sequence[int]) -> _Tried:
        return _Tried(**{name: value[which] for name, value in vars(self).items()})


def find_placement(arm: ArmModel, targets: Vector, given: Mapping[str, Any]) -> Placement:
    """Return the best place for the grip poses ``targets`` (k, 4, 4) in the arm's bending frame.

    What is ``given`` of a :class:`Placement` stays as it is. Deterministic, and remembered.
    Raises InputError, which says what is missing, where no place lets the arm reach all poses with
    5° of joint-limit margin, clear of itself, of the floor and of the sheet.
    """
    return _find(arm, targets.tobytes(), tuple(given.items()))


@functools.lru_cache(maxsize=64)
def _find(arm: ArmModel, poses: bytes, given: tuple[tuple[str, Any], ...]) -> Placement:
    targets = np.frombuffer(poses).reshape(-1, 4, 4)
    search = _Search(arm, targets, dict(given))
    best = search.run()
    if search.touches_column(best):
        # Rarely: where no other place is found, the contact is told with this one.
        with contextlib.suppress(InputError):
            best = _Search(arm, targets, dict(given), column=True).run()
    return search.placement(best)


class _Search:
    """The search for one arm; ``column``: links may not touch the column under the base."""

    def __init__(
        self, arm: ArmModel, targets: Vector, given: Mapping[str, Any], *, column: bool = False
    ) -> None:
        self._arm, self._targets, self._given = arm, targets, given
        # A base that stands where it is told to, or a posture that is told, leaves none to draw.
        told = any(key in given for key in (*_KEYS[:3], "home_rad"))
        self._draws = not (told or column)
        self._chain = serial_chain(arm)
        self._low, self._high = self._chain.range_rad.T
        self._half = 0.5 * (self._high - self._low) / self._chain.scale
        self._tilt = _tilt(given)
        self._best = self._chain.largest_manipulability
        # Turned about the vertical, a tilted base is another mounting: given by hand, as the tilt.
        tilted = self._tilt is not None
        self._fixed = np.array([key in given for key in _KEYS[:3]] + [tilted or _YAW in given])
        spec = with_gripper(arm.spec(looks=False))
        if column:
            _add_column(spec)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def run(self) -> _Tried:
        """Return the best place; InputError where there is none."""
        tried = [self._coarse()]
        best = self._chosen(tried[0])
        if best is None and self._draws:
            tried.append(self._sampled())
            best = self._chosen(tried[1])
        if best is None:
            raise InputError(self._refusal(min(tried, key=lambda one: float(one.miss.min()))))
        return best

    def _chosen(self, tried: _Tried) -> _Tried | None:
        """Return the best of places that were tried, refined; None where none is allowed."""
        good = np.flatnonzero(tried.score > 0.0)
        order = good[np.argsort(-tried.score[good], kind="stable")]
        free = (tried[[i]] for i in order if not self._touches_itself(tried[[i]]))
        found = [self._refined(start) for start in itertools.islice(free, _REFINED)]
        best = max(found, key=lambda one: float(one.score[0]), default=None)
        return self._climbed(tried) if best is None or best.score[0] <= 0.0 else best

    def _climbed(self, coarse: _Tried) -> _Tried | None:
        """Return a place refined from one that lacks nothing but margin; None: there is none."""
        order = np.argsort(-coarse.score, kind="stable")[:_CLIMBED]
        for i in order[coarse.score[order] > -_NOT_CLEAR]:
            one = self._rounded(self._refine(coarse[[i]]))
            if one.score[0] > 0.0 and not self._touches_itself(one):
                return one
        return None

    def placement(self, best: _Tried) -> Placement:
        """Return a place that was tried, with what was given of it."""
        home = self._given.get("home_rad", tuple(best.q[0, 0].round(6).tolist()))
        base = dict(zip(_KEYS, best.base[0].tolist(), strict=True))
        tilts = {key: self._given[key] for key in _TILTS if key in self._given}
        return Placement(**base, **tilts, home_rad=home)

    def touches_column(self, one: _Tried) -> bool:
        """Tell whether a link touches the column that stands under an upright base."""
        if self._tilt is not None or one.base[0, 2] <= COLUMN_FROM_M:
            return False
        spec = with_gripper(self._arm.spec(looks=False))
        _add_column(spec)
        model = spec.compile()
        return self._touches(model, mujoco.MjData(model), one)

    def _refined(self, start: _Tried) -> _Tried:
        """Return the refined place in whole millimetres, or the start where it is none."""
        refined = self._rounded(self._refine(start))
        if refined.score[0] <= 0.0 or self._touches_itself(refined):
            return self._rounded(start)
        return refined

    def _coarse(self) -> _Tried:
        """Return the most promising of all places and branches, followed along the path."""
        base = self._grid()
        rng = np.random.default_rng(_SEED)
        # A single place is tried with as many postures as places are with few.
        seeds = _SEEDS if len(base) > 1 else _SEEDS_OF_ONE
        starts = rng.uniform(self._low, self._high, (seeds, self._chain.count))
        if "home_rad" in self._given:
            starts = np.array([self._given["home_rad"]])
        every, starts = np.repeat(base, len(starts), axis=0), np.tile(starts, (len(base), 1))
        # In the middle of the path, from where it is half as far to either end.
        middle = len(self._targets) // 2
        q, miss = self._reach(every, middle, starts, None, 30)
        worth = np.minimum(self._chain.manipulability(q) / self._best, self._free(q).min(axis=1))
        worth = np.where(miss < 1e-3, worth, -miss)
        order = np.argsort(-worth, kind="stable")
        _, first = np.unique(np.hstack((every, q))[order].round(3), axis=0, return_index=True)
        kept = order[np.sort(first)][:_KEPT]
        return self._from_middle(every[kept], q[kept])

    def _from_middle(self, base: Vector, q: Vector) -> _Tried:
        """Follow configurations (b, n) of the path's middle to its start, and all along it."""
        # The same pose a whole turn nearer the middle of a wide range.
        turns = np.round((q - 0.5 * (self._low + self._high)) / (2.0 * np.pi))
        q = q - 2.0 * np.pi * np.where(self._chain.slides, 0.0, turns)
        for target in range(len(self._targets) // 2, -1, -1):
            q, _ = self._reach(base, target, q, None, 6)
        return self._follow(base, q)

    def _sampled(self) -> _Tried:
        """Return places found from postures, followed along the path.

        A long chain, or one that leaves its base aside, has few places, and they are between those
        of the grid. So a posture is drawn, the grip turned as in the middle of the path, and the
        base put where the grip then is in its place.
        """
        rng, pose = np.random.default_rng(_SEED), self._targets[len(self._targets) // 2]
        q = rng.uniform(self._low, self._high, (_SAMPLES, self._chain.count))
        base = np.zeros((_SAMPLES, len(_KEYS)))
        base[:, 3] = (
            self._given.get(_YAW, 0.0) if self._fixed[3] else rng.uniform(-np.pi, np.pi, _SAMPLES)
        )
        back = self._back(base)
        q, miss = self._chain.solve(back @ pose[:3, :3], None, q, None, 25)
        _, grip, _, _ = self._chain.forward(q)
        away = (back.transpose(0, 2, 1) @ grip[..., None])[..., 0]
        base[:, :3] = (pose[:3, 3] - away) * [-1.0, 1.0, 1.0]
        worth = np.minimum(self._chain.manipulability(q) / self._best, self._free(q).min(axis=1))
        worth = np.where((miss < 1e-3) & self._stands(base), worth, -1.0)
        kept = np.argsort(-worth, kind="stable")[: 2 * _KEPT]
        return self._from_middle(base[kept], q[kept])

    def _grid(self) -> Vector:
        reach, first = self._chain.length_m, self._targets[0, :3, 3]
        axes = [
            -first[0] + _TOOL_M + reach * np.array(_DISTANCE),
            first[1] + reach * np.array(_LATERAL),
            np.unique(np.clip(first[2] + reach * self._heights(), 0.0, self._highest)),
            np.zeros(1),
        ]
        axes = [
            np.array([self._given[key]], dtype=np.float64) if key in self._given else axis
            for key, axis in zip(_KEYS, axes, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(_KEYS))

    def _heights(self) -> Vector:
        """Return heights of the base above the grip, over the reach: a hanging one is above it."""
        heights, up = np.array(_HEIGHT), 1.0 if self._tilt is None else float(self._tilt[2, 2])
        if up > _UPRIGHT:
            return heights
        return -heights if up < -_UPRIGHT else np.concatenate((heights, -heights))

    @property
    def _highest(self) -> float:
        return _HIGHEST_M if self._tilt is None else _CEILING_M

    def _reach(
        self, base: Vector, target: int, q: Vector, posture: Vector | None, iterations: int
    ) -> tuple[Vector, Vector]:
        """Solve for a target from configurations (b, n) on bases (b, 4), in the base frames."""
        pose, back = self._targets[target], self._back(base)
        away = pose[:3, 3] - base[:, :3] * [-1.0, 1.0, 1.0]
        place = (back @ away[..., None])[..., 0]
        return self._chain.solve(back @ pose[:3, :3], place, q, posture, iterations)

    def _back(self, base: Vector) -> Vector:
        """Return the rotations (b, 3, 3) from the bending frame to those of bases (b, 4)."""
        c, s = np.cos(base[:, 3]), np.sin(base[:, 3])
        none, one = np.zeros(len(base)), np.ones(len(base))
        back = np.stack((c, s, none, -s, c, none, none, none, one), axis=1).reshape(-1, 3, 3)
        return back if self._tilt is None else np.asarray(self._tilt.T @ back)

    def _follow(self, base: Vector, start: Vector) -> _Tried:
        """Go through all targets from configurations near the first; the first is the posture."""
        home, missed = self._reach(base, 0, start, start, 15)
        q, worst = home, missed
        path = []
        for target in range(len(self._targets)):
            q, missed = self._reach(base, target, q, home, 12)
            worst = np.maximum(worst, missed)
            path.append(q)
        every = np.stack(path, axis=1)
        flat = every.reshape(-1, self._chain.count)
        _, grip, axes, points = self._chain.forward(flat)
        jacobian = self._chain.jacobian(grip, axes, points)
        manipulability = volume(jacobian).reshape(len(base), -1).min(axis=1)
        clear = self._clear(base, points.reshape(*every.shape, 3))
        margin = self._chain.margins(every).min(axis=(1, 2))
        free = self._free(every).min(axis=(1, 2))
        worth = np.minimum(manipulability / self._best, free)
        allowed = (worst < _REACHED) & (margin >= MIN_MARGIN_RAD) & clear
        # What is not allowed is below 0, by the margin that it lacks where it lacks nothing else.
        lacks = (worst >= _REACHED) | ~clear
        short = np.where(lacks, -_NOT_CLEAR, margin - MIN_MARGIN_RAD)
        score = np.where(allowed, worth, short)
        return _Tried(base=base, q=every, score=score, margin=margin, miss=worst)

    def _free(self, q: Vector) -> Vector:
        """Return the joint-limit margins (..., n) over half the range."""
        return np.asarray(self._chain.margins(q) / self._half)

    def _clear(self, base: Vector, points: Vector) -> NDArray[np.bool_]:
        """Tell where no joint (b, k, n, 3) is near the floor, or beyond the grip at the sheet."""
        c, s = np.cos(base[:, 3])[:, None, None], np.sin(base[:, 3])[:, None, None]
        if self._tilt is not None:
            points = points @ self._tilt.T
        forward = c * points[..., 0] - s * points[..., 1] - base[:, 0][:, None, None]
        height = points[..., 2] + base[:, 2][:, None, None]
        behind = forward < self._targets[:, 0, 3][:, None] - _BEHIND_GRIP_M
        if self._fixed.all():
            # Two arms on one torso stand beside the sheet, and reach over to its ends.
            aside = s * points[..., 0] + c * points[..., 1] + base[:, 1][:, None, None]
            behind |= np.abs(aside) > _BESIDE_SHEET_M
        # The first joint's point is anywhere on its axis.
        fine = (behind & (height > _ABOVE_FLOOR_M))[..., 1:].all(axis=(1, 2))
        return np.asarray(fine & self._stands(base))

    def _stands(self, base: Vector) -> NDArray[np.bool_]:
        stands = (base[:, 2] >= 0.0) & (base[:, 2] <= self._highest)
        return np.asarray(stands & ((base[:, 0] > _NEAREST_M) | self._fixed[0]))

    def _touches_itself(self, one: _Tried) -> bool:
        return self._touches(self._model, self._data, one)

    @staticmethod
    def _touches(model: mujoco.MjModel, data: mujoco.MjData, one: _Tried) -> bool:
        for q in one.q[0]:
            data.qpos[:] = q
            mujoco.mj_forward(model, data)
            if data.ncon:
                return True
        return False

    def _refine(self, one: _Tried) -> _Tried:
        """Climb by a pattern of steps that shrink; what is given by hand is not moved."""
        reach = self._chain.length_m
        for share in _STEPS:
            sizes = np.array([share * reach] * 3 + [_TURN_STEP_RAD])
            for _ in range(_ROUNDS):
                moves = np.concatenate((np.diag(sizes), -np.diag(sizes)))
                still = self._fixed.copy()
                # A turn of the base only moves the range of an upright first joint.
                still[3] |= int(np.argmin(self._free(one.q[0]).min(axis=0))) != 0
                moves = moves[~np.tile(still, 2)]
                bases = one.base + moves
                starts = np.repeat(one.q[:, 0], len(bases), axis=0)
                if self._chain.count > 6 and "home_rad" not in self._given:
                    swing = share / _STEPS[0] * _POSTURE_STEP_RAD * self._null(one)
                    swings = np.concatenate((swing, -swing))
                    bases = np.concatenate((bases, np.repeat(one.base, len(swings), axis=0)))
                    starts = np.concatenate((starts, one.q[:, 0] + swings))
                if not len(bases):
                    return one
                around = self._follow(bases, starts)
                best = int(np.argmax(around.score))
                if around.score[best] < one.score[0] + 1e-4:
                    break
                one = around[[best]]
        return one

    def _null(self, one: _Tried) -> Vector:
        """Return the motions (n - 6, n) of a redundant arm that leave the grip where it is."""
        _, grip, axes, points = self._chain.forward(one.q[:, 0])
        return np.asarray(np.linalg.svd(self._chain.jacobian(grip, axes, points)[0])[2][6:])

    def _rounded(self, one: _Tried) -> _Tried:
        """Return the place in whole millimetres, as a scenario would have it."""
        base = np.where(self._fixed, one.base, one.base.round(3))
        return self._follow(base, one.q[:, 0])

    def _refusal(self, tried: _Tried) -> str:
        arm = self._arm
        head = f"arm {arm.name!r} (reach {arm.reach_m:g} m) finds no place to stand: "
        reached = tried.miss < _REACHED
        if not reached.any():
            best = int(np.argmin(tried.miss))
            stuck = self._chain.margins(tried.q[best]).min(axis=0) < _REACHED
            at = [joint for joint, is_stuck in zip(arm.joint_names, stuck, strict=True) if is_stuck]
            return head + (
                f"no base reaches all poses of the path, the best of {len(tried.miss)} misses one "
                f"by {1e3 * arm.reach_m * tried.miss[best]:.0f} mm"
                + (f" with {' and '.join(at)} at a limit" if at else "")
            )
        margin, needed = np.degrees(tried.margin[reached].max()), np.degrees(MIN_MARGIN_RAD)
        if margin < needed:
            return head + (
                f"where it reaches all poses, a joint comes within {margin:.1f} degrees of its "
                f"limit; {needed:.0f} are needed"
            )
        return head + "where it reaches all poses, it touches itself, the floor or the sheet"


def _add_column(spec: mujoco.MjSpec) -> None:
    """Put a column under the base, as long as any: no link is below the floor."""
    spec.body("base").add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[COLUMN_RADIUS_M, _CEILING_M / 2 - COLUMN_RADIUS_M, 0.0],
        pos=[0.0, 0.0, -_CEILING_M / 2],
        mass=0.0,
    )


def _tilt(given: Mapping[str, Any]) -> Vector | None:
    """Return R_y(pitch) R_x(roll) (3, 3) of a base that does not stand upright."""
    roll, pitch = (float(given.get(key, 0.0)) for key in _TILTS)
    if roll == pitch == 0.0:
        return None
    quat, turn = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quat, np.array([pitch, roll, 0.0]), "yxz")
    mujoco.mju_quat2Mat(turn, quat)
    return turn.reshape(3, 3)
