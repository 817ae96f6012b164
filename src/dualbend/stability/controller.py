"""The admittance with a model as blocks, for the analysis of the loop that it closes.

The matrices are those of `ModelAdmittance.point` and the filters those that run, so what is judged
is what runs; a stream of `comply()` calls and these blocks agree to rounding (tested).
"""

from __future__ import annotations

from itertools import pairwise

import msgspec
import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig, AxisConfig
from dualbend.control.compliance.model import ModelAdmittance, ModelPoint
from dualbend.control.filters import LowPass
from dualbend.stability.state_space import Blocks, parallel, realised
from dualbend.types import Vector


def controller_blocks(
    admittance: ModelAdmittance,
    alpha_rad: float,
    acting: tuple[bool, bool],
    actuator: Blocks,
    low_pass: LowPass,
) -> Blocks:
    """Return filtered wrench (2,) → deviations (2,) at one bending angle.

    Parameters
    ----------
    admittance
        What runs; its last deviations and the model of its own motion are states.
    alpha_rad
        Where its tables are read.
    acting
        Axes that take part; the other one's deviation is 0.
    actuator
        One axis from the deviation sent to position and acceleration as old as a reading.
    low_pass
        What the model's readings are filtered with.
    """
    point = admittance.point(alpha_rad)
    lead = _leads(admittance, point)
    filters = _filters(admittance, point, acting)
    own, last = _own_motion(admittance, point, actuator, low_pass), _last(admittance, point)
    return _static(np.diag([point.slope, 1.0])).then(_closed(lead, filters, own, last))


def _static(matrix: Vector) -> Blocks:
    rows, columns = matrix.shape
    return Blocks(
        a=np.zeros((0, 0)), b=np.zeros((0, columns)), c=np.zeros((rows, 0)), d=np.asarray(matrix)
    )


def _leads(admittance: ModelAdmittance, point: ModelPoint) -> Blocks:
    """Return Λ E."""
    parts = parallel(
        _static(np.eye(1)) if lead is None else realised(lead.transfer_function(point.lead_share))
        for lead in admittance.leads
    )
    return _static(point.estimate).then(parts)


def _filters(admittance: ModelAdmittance, point: ModelPoint, acting: tuple[bool, bool]) -> Blocks:
    """Return the admittance's own filters, fed with what they are fed with."""
    parts = parallel(
        realised(axis.transfer_function())
        if axis is not None and acts
        else _static(np.zeros((1, 1)))
        for axis, acts in zip(admittance.axes, acting, strict=True)
    )
    return _static(np.diag(point.gain)).then(parts)


def _own_motion(
    admittance: ModelAdmittance, point: ModelPoint, actuator: Blocks, low_pass: LowPass
) -> Blocks:
    """Return deviations → the part of the filtered wrench that they have made, K q + M q̈."""
    if admittance.config.predictor is None:
        return _static(np.zeros((2, 2)))
    filtered = realised(low_pass.transfer_function())
    read = parallel([actuator] * 2).then(parallel([filtered] * 4))
    inertia = np.diag([point.slope, 1.0]) @ point.inertia @ point.sent
    return read.scaled(np.stack([point.stiffness, inertia], axis=-1).reshape(2, 4))


def _last(admittance: ModelAdmittance, point: ModelPoint) -> Blocks:
    """Return deviations → −E K times those of the cycle before."""
    if admittance.config.predictor is None:
        return _static(np.zeros((2, 2)))
    held = realised((np.array([0.0, 1.0]), np.ones(1)))
    return parallel([held] * 2).scaled(-point.estimate @ point.stiffness)


def _closed(lead: Blocks, filters: Blocks, own: Blocks, last: Blocks) -> Blocks:
    """Close δ = filters(lead(w + own δ) + last δ); own and last know the past only."""
    assert not own.d.any()
    assert not last.d.any()
    sizes = [block.a.shape[0] for block in (lead, filters, own, last)]
    size = sum(sizes)
    starts = np.cumsum([0, *sizes])
    state = [np.eye(size)[a:b] for a, b in pairwise(starts)]

    def rows(on_state: Vector, on_wrench: Vector) -> Vector:
        return np.hstack([on_state, on_wrench])

    wrench = rows(own.c @ state[2], np.eye(2))
    error = lead.d @ wrench + rows(lead.c @ state[0] + last.c @ state[3], np.zeros((2, 2)))
    out = filters.d @ error + rows(filters.c @ state[1], np.zeros((2, 2)))
    ahead = np.vstack(
        [
            rows(block.a @ x, np.zeros((block.a.shape[0], 2))) + block.b @ given
            for block, x, given in zip(
                (lead, filters, own, last), state, (wrench, error, out, out), strict=True
            )
        ]
    )
    return Blocks(a=ahead[:, :size], b=ahead[:, size:], c=out[:, :size], d=out[:, size:])


def plain_admittance(admittance: ModelAdmittance, alpha_rad: float) -> Admittance:
    """Return the paper's admittance with the gains of one bending angle, in SI.

    What the continuous formulas can speak of: no prediction, no fusion, each axis alone.
    """
    config = admittance.config
    if config.schedule is None:
        return Admittance(_without_model(config), period_s=COMMAND_PERIOD_S)
    stiffness = np.diag(admittance.point(alpha_rad).stiffness)

    def scaled(axis: AxisConfig | None, by: float) -> AxisConfig | None:
        if axis is None:
            return None
        return msgspec.structs.replace(axis, b=axis.b * by, k=axis.k * by)

    return Admittance(
        msgspec.structs.replace(
            _without_model(config),
            units="si",
            x=scaled(config.x, float(stiffness[0])),
            rotation=scaled(config.rotation, float(stiffness[1])),
        ),
        period_s=COMMAND_PERIOD_S,
    )


def _without_model(config: AdmittanceConfig) -> AdmittanceConfig:
    units = "si" if config.units == "sheet" else config.units
    return msgspec.structs.replace(
        config, units=units, schedule=None, reference=None, fusion=None, predictor=None
    )
