"""Models of many worlds as one of MuJoCo Warp's, whose numbers have a leading axis of worlds."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Sequence
from dataclasses import fields

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from dualbend.errors import InputError
from dualbend.types import Vector

_MAY_CHANGE = ("site_pos", "site_quat")
"""Fields that get a row for each world because grips may be displaced."""

_HOLD_WEIGHT = 2.0
"""By which mass and inertia MuJoCo is to scale a hold, over those of the lightest body held.

As :func:`dualbend.scene.cell.harden_holds` has them, which single precision cannot bear: from ten
times that inertia on there are steps in which forces jump, from hundreds on the solver's Hessian is
not positive definite. Lighter holds yield, but less than the sheet that is light (docs/gpu.md).
"""


def put_models(models: Sequence[mujoco.MjModel]) -> tuple[mjw.Model, mjw.Data]:
    """Return model and data of n worlds on the present device, without contacts.

    What differs between the models gets a row for each world. Raises InputError where they differ
    in more than numbers, or have what MuJoCo Warp cannot do.
    """
    taken = {id(model): _accepted(model) for model in models}
    models = [taken[id(model)] for model in models]
    different = _different(models)
    try:
        with warnings.catch_warnings():
            # Of friction in contacts, of which there are none.
            warnings.simplefilter("ignore", UserWarning)
            model = mjw.put_model(models[0], dict.fromkeys(different, len(models)))
    except (NotImplementedError, ValueError) as error:
        raise InputError(f"MuJoCo Warp cannot simulate this cell: {error}") from error
    for name, values in different.items():
        array = getattr(model, name)
        array.assign(values.reshape(*array.shape, *getattr(array.dtype, "_shape_", ())))
    # MuJoCo Warp takes 1e-6 for anything less; forces would jump, as with MuJoCo's own 1e-8.
    model.opt.tolerance.fill_(models[0].opt.tolerance)
    # What overflows is a world's fault and is read as such.
    model.opt.warn_overflow = 0
    data = mjw.make_data(models[0], nworld=len(models), nconmax=0, njmax=_most_rows(models))
    _place_what_stands(models, data)
    return model, data


def _accepted(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a model as MuJoCo Warp takes it: no flag that it lacks, sparse, nothing touches."""
    accepted = copy.copy(model)
    flags = mujoco.mjtDisableBit
    accepted.opt.disableflags &= ~int(flags.mjDSBL_AUTORESET)
    accepted.opt.disableflags |= int(flags.mjDSBL_CONTACT)
    accepted.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    held = accepted.site_bodyid[np.concatenate((accepted.eq_obj1id, accepted.eq_obj2id))]
    # With sparse Jacobians it reads those of the moving bodies that the held ones are fixed to.
    moving = accepted.body_weldid[held]
    of_bodies = accepted.body_mass, accepted.body_inertia
    lightest = np.array([values[moving].min() for values in of_bodies])
    for bodies in (held, moving):
        accepted.body_invweight0[bodies] = np.reciprocal(_HOLD_WEIGHT * lightest)
    return accepted


def _different(models: Sequence[mujoco.MjModel]) -> dict[str, Vector]:
    """Return the fields, of those that may have a leading axis, that are not all equal (n, ...)."""
    first = models[0]
    others = {id(model): model for model in models if model is not first}.values()
    for other in others:
        if other.signature != first.signature or other.nv != first.nv:
            raise InputError("worlds of one batch differ in numbers alone, not in their structure")
    found = {}
    for field in fields(mjw.Model):
        if getattr(field.type, "shape", ("",))[:1] != ("*",):
            continue
        mine = getattr(first, field.name)
        if field.name in _MAY_CHANGE or any(
            not np.array_equal(mine, getattr(other, field.name)) for other in others
        ):
            found[field.name] = np.array([getattr(model, field.name) for model in models])
    return found


def _most_rows(models: Sequence[mujoco.MjModel]) -> int:
    """Return how many rows of constraints there may be: holds, friction, all limits at once."""
    first = models[0]
    friction = np.any([model.dof_frictionloss > 0 for model in models], axis=0)
    return int(6 * first.neq + friction.sum() + first.jnt_limited.sum())


def _place_what_stands(models: Sequence[mujoco.MjModel], data: mjw.Data) -> None:
    """Place the shapes that never move, which MuJoCo Warp places once, as each world has them."""
    places = {}
    for model in {id(model): model for model in models}.values():
        at = mujoco.MjData(model)
        mujoco.mj_kinematics(model, at)
        places[id(model)] = at.geom_xpos.copy(), at.geom_xmat.copy().reshape(-1, 3, 3)
    data.geom_xpos.assign(np.array([places[id(model)][0] for model in models]))
    data.geom_xmat.assign(np.array([places[id(model)][1] for model in models]))


def floats(array: wp.array) -> wp.array:
    """Return an array (n, ...) of vectors or matrices as the floats that it is, (n, m)."""
    per_world = int(array.strides[0] // 4)
    return wp.array(
        ptr=array.ptr, dtype=float, shape=(array.shape[0], per_world), device=array.device
    )
