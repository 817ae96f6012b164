"""The admittance with a model: scheduled gains, force reference, fused readings, prediction.

Each part is a switch of its own; without all of them this is the paper's admittance. In one cycle,
with w force x and moment as read, w₀ the reference, K and M the known stiffness and tool inertia,
q the loop's own deviations as old as the reading, q_n the nominal motion:

    ŵ = f(w + M (q̈ + q̈_n)) − f(w₀) + K q    error without the loop's own part (predictor)
    e = Λ(E ŵ) − E K δ[n−1]                  as a deviation, E = diag(1/K_ii) or fused; Λ the lead
    δ = H e (schedule) or H diag(K_ii) e      the filters of the paper
"""

from __future__ import annotations

import msgspec
import numpy as np

from dualbend.control.compliance.admittance import Admittance, ModelAdmittanceConfig
from dualbend.control.compliance.predictor import ResponseLead, ResponseModel, lead_share
from dualbend.control.compliance.reference import moment_rows, reference
from dualbend.control.compliance.schedule import FusionConfig, KnownSheet
from dualbend.control.response import CommandResponseConfig
from dualbend.types import PlanarPose, Reals, Vector, matvec


class ModelPoint(msgspec.Struct, frozen=True, kw_only=True):
    """The controller's matrices at bending angles ``alpha_rad`` of any leading shape.

    ``rows`` (..., 2, 3): what is taken of force x, z and moment; ``reference`` (..., 2);
    ``estimate`` E (..., 2, 2): errors to deviations; ``stiffness`` K (..., 2, 2) and ``inertia`` M
    (..., 2, 3) of the prediction, ``deviation_jacobian`` (..., 3, 2); ``gain`` (..., 2): what the
    filters' input is multiplied with; ``lead_share`` (...): of the error.
    """

    alpha_rad: Vector
    rows: Vector
    reference: Vector
    estimate: Vector
    stiffness: Vector
    inertia: Vector
    deviation_jacobian: Vector
    gain: Vector
    lead_share: Vector


class ModelAdmittance(Admittance):
    """Both axes of one arm with what is known of sheet, arms and tool.

    Parameters
    ----------
    response
        How a command is answered, for the lead.
    own, nominal
        Models at rest, of the two deviations (with transport delay) and of the nominal x, z, α
        (without), of the same leading shape.
    """

    def __init__(
        self,
        config: ModelAdmittanceConfig,
        *,
        known: KnownSheet,
        response: CommandResponseConfig,
        own: ResponseModel,
        nominal: ResponseModel,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.config: ModelAdmittanceConfig
        self.known, self._own, self._nominal = known, own, nominal
        predictor = config.predictor
        lags = (predictor.lead_x_s, predictor.lead_rotation_s) if predictor else (None, None)
        self.leads = tuple(
            None if lag is None else ResponseLead(response, lag, period_s=period_s, shape=shape)
            for lag in lags
        )
        super().__init__(config, period_s=period_s, shape=shape)
        self._last = np.zeros_like(self._pole)
        self._placed = False

    def point(self, alpha_rad: Reals) -> ModelPoint:
        """Return the matrices at bending angles (...) [rad]."""
        config, known, alpha = self.config, self.known, np.asarray(alpha_rad)
        rows = moment_rows(config.reference, known, alpha)
        first = config.schedule.from_rad if config.schedule else 0.0
        stiffness = rows @ known.tangent(np.maximum(alpha, first))
        inertia, jacobian = known.tool(alpha)
        predictor = config.predictor
        own = np.diagonal(stiffness, axis1=-2, axis2=-1)
        return ModelPoint(
            alpha_rad=alpha,
            rows=rows,
            reference=reference(config.reference, known, alpha, rows),
            estimate=_estimate(config.fusion, stiffness),
            stiffness=stiffness,
            inertia=rows @ inertia * (predictor is not None and predictor.inertia),
            deviation_jacobian=jacobian,
            gain=np.ones_like(own) if config.schedule else own,
            lead_share=lead_share(predictor, alpha) if predictor else np.zeros(alpha.shape),
        )

    def _error(self, wrench: Vector, point: ModelPoint) -> Vector:
        """Return the error (..., 2) of force x and moment, as taken and without the inertia."""
        schedule = self.config.schedule
        error: Vector = wrench - point.reference
        if schedule and schedule.curve:
            forces = np.array((wrench[..., 0], point.reference[..., 0]))
            at = np.maximum(point.alpha_rad, schedule.from_rad)
            inward, right = self.known.displacement(forces, at)
            error[..., 0] = -point.stiffness[..., 0, 0] * (inward - right)
        return error

    def slope(self, point: ModelPoint) -> Vector:
        """Return the slope (...) of the curve that the force passes through, 1 without one.

        It is d(K₁₁ e(F))/dF at the reference, a difference over 0.2 N.
        """
        schedule, taken = self.config.schedule, self.config.reference
        if not (schedule and schedule.curve):
            return np.ones(point.alpha_rad.shape)
        at = np.maximum(point.alpha_rad, schedule.from_rad)
        force = self.known.force(np.maximum(point.alpha_rad, taken.from_rad)) if taken else 0.0
        low, high = (self.known.displacement(force + by, at) for by in (-0.1, 0.1))
        return np.asarray(-point.stiffness[..., 0, 0] * (high - low) / 0.2)

    def rest_compliance(self, alpha_rad: float) -> Vector:
        """Return the deviations at rest (2, 2) per error of force x and moment as taken."""
        point = self.point(alpha_rad)
        static = [0.0 if axis is None else axis.static_compliance for axis in self.axes]
        return np.asarray((np.array(static) * point.gain)[:, np.newaxis] * point.estimate)

    def comply(self, wrench: Vector, pose: PlanarPose) -> Vector:
        """Run one cycle as the admittance does; the first pose is taken as rest."""
        if not self._placed:
            self._nominal.reset(pose.coordinates)
            self._placed = True
        nominal, nominal_acceleration = self._nominal.read()
        own, acceleration = self._own.read()
        point = self.point(nominal[..., 2])
        taken = matvec(point.rows, wrench)
        predicts = self.config.predictor is not None
        if predicts:
            moved = nominal_acceleration + matvec(point.deviation_jacobian, acceleration)
            taken = taken + matvec(point.inertia, moved)
        error = self._error(taken, point)
        if predicts:
            error = error + matvec(point.stiffness, own)
        e = matvec(point.estimate, error)
        for i, lead in enumerate(self.leads):
            if lead is not None:
                e[..., i] += point.lead_share * (lead.update(e[..., i]) - e[..., i])
        if predicts:
            e -= matvec(point.estimate @ point.stiffness, self._last)
        self._last = self.update(e * point.gain, pose.alpha_rad)
        self._own.send(self._last)
        self._nominal.send(pose.coordinates)
        return self._last


def _estimate(config: FusionConfig | None, stiffness: Vector) -> Vector:
    """Return E (..., 2, 2): the error of force x and moment to the deviation that relieves it."""
    estimate = np.zeros(stiffness.shape)
    for i in range(2):
        estimate[..., i, i] = 1.0 / stiffness[..., i, i]
    if config is not None:
        variance = np.array([config.force_error_n, config.moment_error_nm]) ** 2
        first = stiffness[..., 0]
        weights = first / variance
        total = weights[..., :1] * first[..., :1] + weights[..., 1:] * first[..., 1:]
        estimate[..., 0, :] = weights / total
    return estimate
