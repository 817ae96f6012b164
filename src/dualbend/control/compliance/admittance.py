"""The admittance that turns the force along x and the moment about y into a deviation.

B δ' + K δ = F (paper (7)), sampled once per command period T with the pole a = e^(−kT/b).
Sign: δ = H F with F the wrench on the arm, so the arm yields in the direction of the force.
No vertical force enters; the moment that the sheet's own weight makes does.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np

from dualbend.control.clock import TransferFunction
from dualbend.control.compliance.base import AxisConfig, ComplianceBase
from dualbend.control.compliance.mass_spring_damper import MassSpringDamperConfig
from dualbend.control.compliance.own import OwnComplianceConfig
from dualbend.control.compliance.predictor import PredictorConfig
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, ScheduleConfig
from dualbend.control.worlds import stacked
from dualbend.errors import InputError
from dualbend.types import Mask, PlanarPose, Reals, Vector, said

MM_PER_M = 1e3
DEG_PER_RAD = 180.0 / math.pi


class NoComplianceConfig(ComplianceBase, tag="none"):
    """The arms follow their path whatever the sensors read."""


class _TwoAxes(ComplianceBase):
    """Which axes comply and how far; an axis that is None is off."""

    x: AxisConfig | None = None
    rotation: AxisConfig | None = None
    limit_x_m: Annotated[float, said("largest |δx| [m]", gt=0, le=1)] = 0.02
    limit_rotation_rad: Annotated[float, said("largest |δα| [rad]", gt=0, le=3.15)] = 0.1
    tare: Annotated[bool, said("loads count from the first reading after switching on")] = False


class AdmittanceConfig(_TwoAxes, tag="admittance"):
    """The paper's compliance: constant gains along x and about y, on the wrench alone.

    `units`: "paper" means N, mm, N m and degrees for b and k; "si" means N s/m, N/m, N m s/rad and
    N m/rad. An axis that is None is off. With `tare` an axis sees the wrench relative to the first
    reading after it is switched on. A complying arm without a sensor mirrors the deviation of the
    arm that has one.
    """

    units: Annotated[Literal["paper", "si"], said("in which b and k are given")] = "paper"


class ModelAdmittanceConfig(_TwoAxes, tag="model"):
    """Compliance that knows sheet, arms and tool: each part goes beyond the paper by itself.

    `units` as of kind = "admittance"; "sheet" means s and 1, multiples of the known stiffness, and
    belongs to `schedule`. See `dualbend.control.compliance.model`.
    """

    units: Annotated[Literal["paper", "si", "sheet"], said("in which b and k are given")] = "paper"
    schedule: ScheduleConfig | None = None
    reference: ReferenceConfig | None = None
    fusion: FusionConfig | None = None
    predictor: PredictorConfig | None = None

    def __post_init__(self) -> None:
        """Refuse gains in units that the schedule does not give, and the other way round."""
        super().__post_init__()
        if (self.units == "sheet") != (self.schedule is not None):
            raise InputError(
                'units = "sheet" and the section schedule belong together: with it b is in s and '
                "k is a ratio to the sheet's stiffness"
            )

    @property
    def beyond(self) -> str:
        """What of it needs to know the sheet, in words; "" where nothing does."""
        names = ("schedule", "reference", "fusion", "predictor")
        given = [f"compliance.{name}" for name in names if getattr(self, name) is not None]
        return f"{', '.join(given)} goes beyond the paper" if given else ""


ComplianceConfig: TypeAlias = (
    AdmittanceConfig
    | ModelAdmittanceConfig
    | MassSpringDamperConfig
    | OwnComplianceConfig
    | NoComplianceConfig
)
"""How an arm complies with the wrench that it reads."""


def si_per_unit(units: str, name: Literal["x", "rotation"]) -> float:
    """Return what takes a configured b or k to SI: 1000 for mm, 180/π for degrees, 1 for SI."""
    if units != "paper":
        return 1.0
    return MM_PER_M if name == "x" else DEG_PER_RAD


class AdmittanceAxis:
    """The first-order filter of one axis, H(z) = g / (1 − a z⁻¹), in SI.

    ``to_si`` takes b and k to SI; ``limit`` is the largest |δ| [m or rad].
    """

    def __init__(self, config: AxisConfig, *, period_s: float, to_si: float, limit: float) -> None:
        b, k = config.b * to_si, config.k * to_si
        self.pole = math.exp(-k * period_s / b)
        self._one_minus_pole = -math.expm1(-k * period_s / b)
        self.gain = {
            "printed": 1.0 / b,
            "impulse-invariant": period_s / b,
            "static": self._one_minus_pole / k,
        }[config.form]
        self.limit = limit
        self.from_alpha_rad = config.from_alpha_rad

    def transfer_function(self) -> TransferFunction:
        """Tell H(z), without the bound, in powers of z⁻¹ [m/N] or [rad/(N m)]."""
        return np.array([self.gain]), np.array([1.0, -self.pole])

    @property
    def static_compliance(self) -> float:
        """Deviation per steady load g/(1 − a) [m/N] or [rad/(N m)]: 1/k in the static form."""
        return self.gain / self._one_minus_pole


class Admittance:
    """Both axes of an arm's compliance, δ[n] = a δ[n−1] + g F[n]; an axis that is off stays at 0.

    The state itself is bounded, so it cannot wind up. Below its `from_alpha_rad` an axis sees no
    load: δ is 0 before it first acts, and decays with the pole when the sheet is unfolded again,
    instead of jumping.

    Parameters
    ----------
    shape
        With an axis of arms where there is one.

    Attributes
    ----------
    x, rotation
        The filters that run, or None.
    saturated
        (..., 2): the deviation is at its bound.
    """

    def __init__(
        self, config: ComplianceConfig, *, period_s: float, shape: tuple[int, ...] = ()
    ) -> None:
        self.config, self.period_s = config, period_s

        def axis(name: Literal["x", "rotation"], limit: float) -> AdmittanceAxis | None:
            settings: AxisConfig | None = getattr(config, name)
            if settings is None:
                return None
            to_si = si_per_unit(config.units, name)
            return AdmittanceAxis(settings, period_s=period_s, to_si=to_si, limit=limit)

        self.x = axis("x", config.limit_x_m)
        self.rotation = axis("rotation", config.limit_rotation_rad)
        # An axis that is off never acts.
        numbers = [
            (0.0, 0.0, math.inf, math.inf)
            if part is None
            else (part.pole, part.gain, part.limit, part.from_alpha_rad)
            for part in self.axes
        ]
        # Of the state's own shape: that is cheaper, every cycle, than to broadcast.
        self._pole, self._gain, self._limit, self._from_alpha = (
            np.broadcast_to(column, (*shape, 2)).copy() for column in zip(*numbers, strict=True)
        )
        self._lowest = -self._limit
        self._deviation = np.zeros_like(self._pole)
        self._reference = np.zeros_like(self._pole)
        self._acted: Mask = np.zeros(self._pole.shape, dtype=np.bool_)
        self.saturated: Mask = self._acted

    @classmethod
    def stacked(cls, many: Sequence[Self]) -> Self:
        """Return that of many worlds, each with its own gains and bounds, freshly made."""
        numbers = ("_pole", "_gain", "_limit", "_from_alpha", "_lowest")
        state = ("_deviation", "_reference", "_acted", "saturated")
        return stacked(many, *numbers, *state)

    def axes_at(self, alpha_rad: float) -> tuple[AdmittanceAxis | None, AdmittanceAxis | None]:
        """Return the filters of x and rotation that act at a bending angle [rad]."""
        x, rotation = (
            part if part is not None and part.from_alpha_rad <= alpha_rad else None
            for part in self.axes
        )
        return x, rotation

    @property
    def axes(self) -> tuple[AdmittanceAxis | None, AdmittanceAxis | None]:
        """The filters of x and rotation."""
        return self.x, self.rotation

    def comply(self, wrench: Vector, pose: PlanarPose) -> Vector:
        """Run one cycle; return the deviation (..., 2): δx [m], δα [rad].

        ``wrench``: filtered F_x, F_z [N] and M_y [N m] (..., 3) on the arm in its bending frame;
        the bending angle of the nominal pose (..., 3) there switches the axes on.
        """
        return self.update(wrench[..., ::2].copy(), pose.alpha_rad)

    def update(self, load: Vector, alpha_rad: Reals = math.inf) -> Vector:
        """Take F_x [N] and M_y [N m] (..., 2) at a bending angle (...); return δx, δα (..., 2)."""
        acts: Mask = np.asarray(alpha_rad)[..., np.newaxis] >= self._from_alpha
        if self.config.tare:
            self._reference = np.where(acts & ~self._acted, load, self._reference)
            self._acted = acts
            load = load - self._reference
        if np.count_nonzero(acts) < acts.size:
            load = load * acts
        deviation = self._pole * self._deviation
        deviation += self._gain * load
        within: Vector = np.maximum(deviation, self._lowest)
        np.minimum(within, self._limit, out=within)
        self.saturated, self._deviation = within != deviation, within
        return within
