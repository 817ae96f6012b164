"""The admittance with a model: scheduled gains, force reference, fused readings, prediction.

Each part is a switch of its own; without all of them this is the paper's admittance. In one cycle,
with w force x and moment as read, w₀ the reference, K and M the known stiffness and tool inertia,
q the loop's own deviations as old as the reading, q_n the nominal motion:

    ŵ = f(w + M (q̈ + q̈_n)) − f(w₀) + K q    error without the loop's own part (predictor)
    e = Λ(E ŵ) − E K δ[n−1]                  as a deviation, E = diag(1/K_ii) or fused; Λ the lead
    δ = H e (schedule) or H diag(K_ii) e      the filters of the paper
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dualbend.control.compliance.admittance import (
    Admittance,
    AdmittanceAxis,
    Deviation,
    ModelAdmittanceConfig,
)
from dualbend.control.compliance.predictor import ResponseLead, ResponseModel, lead_share
from dualbend.control.compliance.reference import moment_rows, reference
from dualbend.control.compliance.schedule import FusionConfig, KnownSheet
from dualbend.control.response import CommandResponseConfig
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class ModelPoint:
    """The controller's matrices at one bending angle.

    ``rows`` (2, 3): what is taken of force x, z and moment; ``reference`` (2,); ``estimate`` E
    (2, 2): errors to deviations; ``stiffness`` K (2, 2) and ``inertia`` M (2, 3) of the
    prediction, ``sent`` (3, 2); ``gain`` (2,): what the filters' input is multiplied with;
    ``lead_share``: of
    the error; ``slope``: of the curve that the force passes through, 1 without one.
    """

    rows: Vector
    reference: Vector
    estimate: Vector
    stiffness: Vector
    inertia: Vector
    sent: Vector
    gain: Vector
    slope: float
    lead_share: float


class ModelAdmittance(Admittance):
    """Both axes of one arm with what is known of sheet, arms and tool.

    Parameters
    ----------
    config
        With at least one of schedule, reference, fusion and predictor.
    known
        Tables along the path.
    response
        How a command is answered, for the lead.
    own, nominal
        Models of the two deviations (with transport delay) and of the nominal x, z, α (without).
    """

    def __init__(
        self,
        config: ModelAdmittanceConfig,
        *,
        known: KnownSheet,
        response: CommandResponseConfig,
        own: ResponseModel,
        nominal: ResponseModel,
    ) -> None:
        self.config: ModelAdmittanceConfig
        self.known, self._own, self._nominal = known, own, nominal
        predictor = config.predictor
        lags = (predictor.lead_x_s, predictor.lead_rotation_s) if predictor else (None, None)
        self.leads = tuple(None if lag is None else ResponseLead(response, lag) for lag in lags)
        super().__init__(config)
        self._placed = False
        self._sent = np.zeros(2)

    @property
    def axes(self) -> tuple[AdmittanceAxis | None, AdmittanceAxis | None]:
        """The filters of x and rotation."""
        return self.x, self.rotation

    def reset(self) -> None:
        """Return to no deviation; the next pose is taken as rest."""
        super().reset()
        for lead in self.leads:
            if lead is not None:
                lead.reset()
        self._own.reset(np.zeros(2))
        self._placed = False
        self._sent = np.zeros(2)

    def point(self, alpha_rad: float) -> ModelPoint:
        """Return the matrices at a bending angle [rad]."""
        config, known = self.config, self.known
        rows = moment_rows(config.reference, known, alpha_rad)
        first = config.schedule.from_rad if config.schedule else 0.0
        stiffness = rows @ known.tangent(max(alpha_rad, first))
        inertia, sent = known.tool(alpha_rad)
        counts = config.predictor is not None and config.predictor.inertia
        own = np.diag(stiffness)
        return ModelPoint(
            rows=rows,
            reference=reference(config.reference, known, alpha_rad, rows),
            estimate=_estimate(config.fusion, stiffness),
            stiffness=stiffness,
            inertia=rows @ inertia * float(counts),
            sent=sent,
            gain=np.ones(2) if config.schedule else own,
            lead_share=lead_share(config.predictor, alpha_rad) if config.predictor else 0.0,
            slope=self._slope(alpha_rad, float(stiffness[0, 0])),
        )

    def _error(self, wrench: Vector, point: ModelPoint, alpha_rad: float) -> Vector:
        """Return the error (2,) of force x and moment, as taken and without the inertia."""
        schedule = self.config.schedule
        error = np.asarray(wrench - point.reference)
        if schedule and schedule.curve:
            at = max(alpha_rad, schedule.from_rad)
            inward = self.known.displacement(float(wrench[0]), at)
            right = self.known.displacement(float(point.reference[0]), at)
            error[0] = -point.stiffness[0, 0] * (inward - right)
        return error

    def _slope(self, alpha_rad: float, stiffness_n_per_m: float) -> float:
        """Return d(K₁₁ e(F))/dF at the reference, a difference over 0.2 N."""
        schedule, taken = self.config.schedule, self.config.reference
        if not (schedule and schedule.curve):
            return 1.0
        at = max(alpha_rad, schedule.from_rad)
        force = self.known.force(max(alpha_rad, taken.from_rad)) if taken else 0.0
        ends = [self.known.displacement(force + by, at) for by in (-0.1, 0.1)]
        return -stiffness_n_per_m * (ends[1] - ends[0]) / 0.2

    def rest_compliance(self, alpha_rad: float) -> Vector:
        """Return the deviations at rest (2, 2) per error of force x and moment as taken."""
        point = self.point(alpha_rad)
        static = [0.0 if axis is None else axis.static_compliance for axis in self.axes]
        return np.asarray((np.array(static) * point.gain)[:, np.newaxis] * point.estimate)

    def comply(
        self, force_x_n: float, force_z_n: float, moment_y_nm: float, pose: Vector
    ) -> Deviation:
        """Run one cycle on the filtered wrench in B, at the nominal x, z [m], α [rad] (3,)."""
        if not self._placed:
            self._nominal.reset(pose)
            self._placed = True
        nominal, nominal_acceleration = self._nominal.read()
        own, acceleration = self._own.read()
        point = self.point(float(nominal[2]))
        wrench = np.asarray(point.rows @ [force_x_n, force_z_n, moment_y_nm])
        predicts = self.config.predictor is not None
        if predicts:
            wrench = wrench + point.inertia @ (nominal_acceleration + point.sent @ acceleration)
        error = self._error(wrench, point, float(nominal[2]))
        if predicts:
            error = error + point.stiffness @ own
        e = point.estimate @ error
        for i, lead in enumerate(self.leads):
            if lead is not None:
                e[i] += point.lead_share * (lead.update(float(e[i])) - e[i])
        if predicts:
            e -= point.estimate @ point.stiffness @ self._sent
        load = e * point.gain
        deviation = self.update(float(load[0]), float(load[1]), float(pose[2]))
        self._sent = np.array([deviation.dx_m, deviation.dalpha_rad])
        self._own.send(self._sent)
        self._nominal.send(pose)
        return deviation


def _estimate(config: FusionConfig | None, stiffness: Vector) -> Vector:
    """Return E (2, 2): the error of force x and moment to the deviation that relieves it."""
    own = np.diag(stiffness)
    estimate = np.diag(1.0 / own)
    if config is not None:
        variance = np.array([config.force_error_n, config.moment_error_nm]) ** 2
        weights = stiffness[:, 0] / variance
        estimate[0] = weights / (weights @ stiffness[:, 0])
    return estimate
