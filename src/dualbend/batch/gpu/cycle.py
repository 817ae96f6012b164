"""One command cycle of many worlds on a device: the kernels that a graph captures."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from dualbend.arm.mjcf import FT_SENSORS, FT_SITE
from dualbend.batch.gpu import kernels
from dualbend.batch.gpu.models import floats, put_models
from dualbend.scene.simulation import Simulation
from dualbend.types import SIDES, Vector

_IGNORED = int(mjw.OverflowType.ITERATIONS | mjw.OverflowType.LS_ITERATIONS)
"""Solvers that came to their last iteration: MuJoCo counts no warning for it, either."""

Columns = dict[str, Vector]
"""Which floats of each field of the data, in a world's row."""


class Cycle:
    """What a command cycle needs on the present device, and its kernels in their order.

    Parameters
    ----------
    simulation
        Of one of the cells: where its things are, and how many steps a cycle has.
    models
        Of each of the n worlds, compiled; they differ in numbers alone.
    stiction
        (n, 2) s and v_s [rad/s] of :class:`dualbend.imperfection.robot.Stribeck`; the models have
        the friction of joints at rest. None: no world has any.

    Attributes
    ----------
    seen, samples : what a loop reads after a cycle; what the wrist sensors had after each step
    fault, touching : (n,) as :class:`dualbend.batch.gpu.physics.WarpPhysics` has them
    """

    def __init__(
        self, simulation: Simulation, models: Sequence[mujoco.MjModel], stiction: Vector | None
    ) -> None:
        model, dofs = models[0], simulation.dofs
        n, joints = len(models), len(dofs)
        self._model, self._data = put_models(models)
        self.steps, self._at = simulation.steps, (n, joints)
        self.compliance = -1.0 / np.array([each.actuator_biasprm[:joints, 1] for each in models])
        self._compliance, self._given, self._fed = (_floats(self.compliance) for _ in range(3))
        self._own, self._dofs = wp.ones(1, dtype=int), wp.array(dofs, dtype=int)
        self._setpoints = _floats(np.zeros((n, self.steps, joints)))
        self._start = _floats(np.zeros((n, model.nq)))
        self.fault, self.touching = (wp.zeros(n, dtype=int) for _ in range(2))
        self.seen = Reading(self._data, _seen(model, dofs), 1)
        self.samples = Reading(self._data, sampled(model), self.steps + 1)
        self._friction = None if stiction is None else _Friction(models, dofs, stiction)
        self._ranges = np.array([each.jnt_actfrcrange for each in models])
        self._model.jnt_actfrcrange = wp.array(self._ranges, dtype=wp.vec2)
        self._joints = simulation.joint_ids

    def reset(self, positions: Vector, drives: Vector) -> None:
        """Put the worlds at rest in positions (n, nq), their drives at angles (n, joints)."""
        model, data = self._model, self._data
        mjw.reset_data(model, data)
        data.qpos.assign(positions)
        self._start.assign(positions)
        ctrl = data.ctrl.numpy()
        ctrl[:, : self._at[1]] = drives
        data.ctrl.assign(ctrl)
        if self._friction is not None:
            self._friction.rest(model)
        mjw.forward(model, data)
        self.samples.take(0)
        self.fault.zero_()
        self.touching.zero_()
        self.refresh()

    def refresh(self) -> None:
        """Bring up to date what is read of the present positions."""
        self._observe()
        self.seen.take(0)

    def limit_torques(self, ranges: Vector) -> None:
        """Say between what the joints' torques are limited, (n, joints, 2) [N m]."""
        self._ranges[:, self._joints] = ranges
        self._model.jnt_actfrcrange.assign(self._ranges)

    def place_sites(self, places: Vector, quats: Vector) -> None:
        """Put the sites elsewhere in their bodies, (n, sites, 3) [m] and (n, sites, 4)."""
        self._model.site_pos.assign(places)
        self._model.site_quat.assign(quats)

    def load(self, setpoints: Vector, given: Vector | None) -> None:
        """Say what the next cycle goes by: set-points (n, steps, joints) [rad].

        ``given``: what is fed forward, (n, joints) [rad]; None: the worlds' own Coriolis torques.
        """
        self._setpoints.assign(setpoints)
        self._own.fill_(given is None)
        if given is not None:
            self._given.assign(given)

    def run(self) -> None:
        """Launch a cycle's kernels, from the drives of its first step to the next positions."""
        data = self._data
        wp.launch(
            kernels.feed_forward,
            self._at,
            [
                *(data.qfrc_bias, data.qfrc_gravcomp, self._dofs, self._compliance),
                *(self._given, self._own, self._fed),
            ],
        )
        for step in range(self.steps):
            wp.launch(kernels.drive, self._at, [self._setpoints, self._fed, step, data.ctrl])
            mjw.step2(self._model, data)
            self.samples.take(step + 1)
            self._note_faults()
            if self._friction is not None:
                self._friction.follow(self._model, data)
            self._observe()
        self.seen.take(0)

    def _note_faults(self) -> None:
        data = self._data
        wp.launch(
            kernels.note_faults,
            self._at[0],
            [
                *(mujoco.mjMAXVAL, _IGNORED, data.overflow, self._start, data.ctrl),
                *(data.qpos, data.qvel, data.qacc, data.qacc_warmstart, self.fault),
            ],
        )

    def _observe(self) -> None:
        """Bring positions and speeds up to date, and look whether shapes may touch."""
        mjw.step1(self._model, self._data)
        look_for_contacts(self._model, self._data, self.touching)


def look_for_contacts(model: mjw.Model, data: mjw.Data, touching: wp.array) -> None:
    """Note the worlds (n,) in which shapes that may collide are not seen to be apart."""
    pairs = model.nxn_geom_pair_filtered
    wp.launch(
        kernels.overlap,
        (data.nworld, len(pairs)),
        [
            *(pairs, model.geom_type, model.geom_size, model.geom_aabb),
            *(data.geom_xpos, data.geom_xmat, touching),
        ],
    )


class _Friction:
    """Dry friction that follows the speed, :class:`dualbend.imperfection.robot.Stribeck`'s."""

    def __init__(self, models: Sequence[mujoco.MjModel], dofs: Vector, stiction: Vector) -> None:
        self._rest = np.array([model.dof_frictionloss for model in models])
        excess, speed = stiction.T[..., np.newaxis]
        coulomb = self._rest[:, dofs] / (1.0 + excess)
        self._laws = [_floats(coulomb), _floats(excess * coulomb), _floats(speed[:, 0] ** -2.0)]
        self._dofs = wp.array(dofs, dtype=int)

    def rest(self, model: mjw.Model) -> None:
        """Let all joints be at rest; the model's friction gets a row for each world."""
        if model.dof_frictionloss.shape == self._rest.shape:
            model.dof_frictionloss.assign(self._rest)
        else:
            model.dof_frictionloss = _floats(self._rest)

    def follow(self, model: mjw.Model, data: mjw.Data) -> None:
        """Follow the speeds after a physics step."""
        inputs = [data.qvel, self._dofs, *self._laws, model.dof_frictionloss]
        wp.launch(kernels.stribeck, self._laws[0].shape, inputs)


class Reading:
    """Columns of some fields, side by side and all read at once, in ``rows`` taken one by one."""

    def __init__(self, data: mjw.Data, columns: Columns, rows: int) -> None:
        self.columns = columns
        self._fields = [
            (floats(getattr(data, name)), wp.array(at, dtype=int)) for name, at in columns.items()
        ]
        self._taken = wp.zeros((rows, data.nworld, sum(map(len, columns.values()))), dtype=float)

    def take(self, row: int) -> None:
        """Take the columns as they are now."""
        first, worlds = 0, self._taken.shape[1]
        for source, at in self._fields:
            wp.launch(kernels.gather, (worlds, len(at)), [source, at, row, first, self._taken])
            first += len(at)

    def read(self, row: int) -> dict[str, Vector]:
        """Return what was taken of each field, (n, columns)."""
        taken = np.asarray(self._taken[row].numpy(), dtype=np.float64)
        ends = np.cumsum([len(at) for at in self.columns.values()])[:-1]
        return dict(zip(self.columns, np.split(taken, ends, axis=1), strict=True))


def _seen(model: mujoco.MjModel, dofs: Vector) -> Columns:
    """Return what a loop reads once a cycle."""
    middle = int(model.joint("sheet").bodyid[0])
    return {
        "qpos": np.arange(model.nq),
        "qvel": np.arange(model.nv),
        "qfrc_actuator": dofs,
        "site_xpos": np.arange(3 * model.nsite),
        "site_xmat": np.arange(9 * model.nsite),
        "xpos": 3 * middle + np.arange(3),
    }


def sampled(model: mujoco.MjModel) -> Columns:
    """Return what the wrist sensors tell: forces and moments by arm, and their axes."""
    sensors = [model.sensor(f"{side}_{name}").adr[0] for side in SIDES for name in FT_SENSORS]
    sites = [model.site(f"{side}_{FT_SITE}").id for side in SIDES]
    return {
        "sensordata": np.add.outer(sensors, np.arange(3)).ravel(),
        "site_xmat": np.add.outer(9 * np.array(sites), np.arange(9)).ravel(),
    }


def _floats(values: Vector) -> wp.array:
    return wp.array(values, dtype=float)
