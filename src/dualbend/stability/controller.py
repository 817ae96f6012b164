"""What a scenario's controller is to the analysis of the loop that it closes.

The matrices of the admittance with a model are those of `ModelAdmittance.point` and the filters
those that run, so what is analysed is what runs; a stream of `comply()` calls and this system agree
to rounding (tested). Of a user's class it is what the object itself says of its transfer functions.
"""

from __future__ import annotations

import msgspec
import numpy as np

from dualbend.control.clock import TransferFunction
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.mass_spring_damper import (
    MassSpringDamperConfig,
    SpatialAdmittance,
)
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.own import OwnComplianceConfig, OwnController
from dualbend.control.filters import LowPass
from dualbend.run.known_sheet import make_admittance, make_compliance
from dualbend.scenario.scenario import Scenario
from dualbend.stability.state_space import StateSpace, from_transfer_function, parallel, static

_MOVED_IN = 1e-8
"""By which part the poles of a pure damper are moved in: at rest it has no value."""


class LinearAxis:
    """One axis of a controller of which nothing but its transfer function is known."""

    def __init__(self, transfer: TransferFunction) -> None:
        numerator, denominator = transfer
        if abs(float(denominator.sum())) < _MOVED_IN:
            denominator = denominator * (1.0 - _MOVED_IN) ** np.arange(len(denominator))
        self._transfer = numerator, denominator

    def transfer_function(self) -> TransferFunction:
        """Tell H(z) in powers of z⁻¹ [m/N] or [rad/(N m)]."""
        return self._transfer

    @property
    def static_compliance(self) -> float:
        """Deviation per steady load H(1) [m/N] or [rad/(N m)]; very large of a pure damper."""
        above, below = (float(part.sum()) for part in self._transfer)
        return above / below


class LinearController:
    """A controller that says by itself what it is at each bending angle, in transfer functions."""

    def __init__(self, controller: OwnController | SpatialAdmittance) -> None:
        self._controller = controller

    def axes_at(self, alpha_rad: float) -> tuple[LinearAxis | None, LinearAxis | None]:
        """Return the filters of x and rotation that act at a bending angle [rad]."""
        x, rotation = (
            None if found is None else LinearAxis(found)
            for found in self._controller.transfer_functions(alpha_rad)
        )
        return x, rotation


def analysed_controller(scenario: Scenario) -> Admittance | LinearController:
    """Return the scenario's controller as the analysis takes it: the object that runs, or by it."""
    if isinstance(scenario.compliance, OwnComplianceConfig | MassSpringDamperConfig):
        controller = make_compliance(scenario)
        assert isinstance(controller, OwnController | SpatialAdmittance)
        return LinearController(controller)
    return make_admittance(scenario)


def controller_system(
    admittance: ModelAdmittance,
    alpha_rad: float,
    acting: tuple[bool, bool],
    actuator: StateSpace,
    low_pass: LowPass,
) -> StateSpace:
    """Return filtered wrench (2,) → deviations (2,) at one bending angle.

    With the lead Λ, the model's estimate E, the filters F, their input's gain, the wrench's slope,
    and the predictor's own wrench O q and last deviation z⁻¹ q:

        q = F gain (Λ E (slope w + O q) − E K z⁻¹ q)

    ``admittance`` is what runs; its last deviations and the model of its own motion are states.
    ``acting``: axes that take part, the other one's deviation is 0. ``actuator``: one axis from the
    deviation sent to position and acceleration as old as a reading; ``low_pass`` filters the
    model's readings.
    """
    point = admittance.point(alpha_rad)
    leads = parallel(
        static(np.eye(1))
        if lead is None
        else from_transfer_function(lead.transfer_function(point.lead_share))
        for lead in admittance.leads
    )
    filters = parallel(
        from_transfer_function(axis.transfer_function())
        if axis is not None and acts
        else static(np.zeros((1, 1)))
        for axis, acts in zip(admittance.axes, acting, strict=True)
    )
    slope, twice = np.diag([float(admittance.slope(point)), 1.0]), np.tile(np.eye(2), 2)
    # Of wrench and error (4,): both add up to what the filters get.
    forward = parallel([static(point.estimate).series(leads), static(np.eye(2))]).scaled(
        np.diag(point.gain) @ twice
    )
    forward = forward.series(filters)
    if admittance.config.predictor is not None:
        read = parallel([actuator] * 2).series(
            parallel([from_transfer_function(low_pass.transfer_function())] * 4)
        )
        inertia = slope @ point.inertia @ point.deviation_jacobian
        own = read.scaled(np.stack([point.stiffness, inertia], axis=-1).reshape(2, 4))
        held = from_transfer_function((np.array([0.0, 1.0]), np.ones(1)))
        last = parallel([held] * 2).scaled(-point.estimate @ point.stiffness)
        forward = forward.feedback(static(twice.T).series(parallel([own, last])))
    return static(np.eye(4, 2) @ slope).series(forward)


def plain_admittance(admittance: ModelAdmittance, alpha_rad: float) -> Admittance:
    """Return the paper's admittance with the gains of one bending angle, in SI.

    The continuous formulas know no more: no prediction, no fusion, each axis by itself.
    """
    config = admittance.config
    plain = {name: getattr(config, name) for name in AdmittanceConfig.__struct_fields__}
    plain["units"] = "paper" if config.units == "paper" else "si"
    if config.schedule is not None:
        plain["units"] = "si"
        stiffness = np.diag(admittance.point(alpha_rad).stiffness).tolist()
        for name, by in zip(("x", "rotation"), stiffness, strict=True):
            axis: AxisConfig | None = plain[name]
            if axis is not None:
                plain[name] = msgspec.structs.replace(axis, b=axis.b * by, k=axis.k * by)
    return Admittance(AdmittanceConfig(**plain), period_s=admittance.period_s)
