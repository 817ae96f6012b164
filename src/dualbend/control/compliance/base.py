"""What every kind of compliance says in a scenario: which arms sense, which of them comply."""

from typing import Annotated, Literal

from dualbend.control.compliance.predictor import PredictorConfig
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.errors import InputError
from dualbend.types import Config, Side, Tagged, said

AdmittanceForm = Literal["printed", "impulse-invariant", "static"]


class AxisConfig(Config):
    """Damping, stiffness and discrete form of one axis.

    `form`: "printed" is (15) as published, δ[n] = a δ[n−1] + F/b, which lacks the factor T of
    impulse invariance; "impulse-invariant" has it, δ[n] = a δ[n−1] + (T/b) F; "static" has the
    true static stiffness k, δ[n] = a δ[n−1] + ((1 − a)/k) F. `units` of the section
    says in which units b and k are.
    """

    b: Annotated[float, said("damping [N s/mm, N m s/deg; or SI]", gt=0, le=1e9)]
    k: Annotated[float, said("stiffness [N/mm, N m/deg; or SI]", gt=0, le=1e9)]
    form: Annotated[
        AdmittanceForm,
        said("(15) as printed, with the missing T, or with the true static stiffness"),
    ] = "printed"
    from_alpha_rad: Annotated[
        float, said("bending angle from which the axis acts [rad]", ge=0, le=3.15)
    ] = 0.0


class DirectionConfig(Config):
    """Mass, damping and stiffness of one direction; with m = 0 and k = 0 it is a pure damper.

    In the dead zone no load acts, beyond it the load less the zone. At its limit the deviation
    stops: it does not wind up, and a mass has no speed there.
    """

    m: Annotated[float, said("mass, or inertia [kg; kg m²]", ge=0, le=1e6)] = 0.0
    b: Annotated[float, said("damping [N s/m; N m s/rad]", gt=0, le=1e9)]
    k: Annotated[float, said("stiffness [N/m; N m/rad]", ge=0, le=1e9)] = 0.0
    dead_zone: Annotated[float, said("load that does nothing [N; N m]", ge=0, le=1e6)] = 0.0
    limit: (
        Annotated[float, said("largest |δ|, else 0.02 m or 0.1 rad [m; rad]", gt=0, le=3)] | None
    ) = None
    from_alpha_rad: Annotated[
        float, said("bending angle from which the load acts [rad]", ge=0, le=3.15)
    ] = 0.0


class ComplianceBase(Tagged):
    """Which arms sense and which comply; what only some kinds have is None in the others."""

    sensing: Annotated[
        tuple[Side, ...], said("arms with a force/torque sensor", min_length=1, max_length=2)
    ] = ("left",)
    complying: Annotated[tuple[Side, ...], said("arms that the compliance moves", max_length=2)] = (
        "left",
    )

    def __post_init__(self) -> None:
        """Refuse an arm that is named twice."""
        for name, sides in (("sensing", self.sensing), ("complying", self.complying)):
            if len(set(sides)) != len(sides):
                raise InputError(f"{name} names an arm twice: {list(sides)}")

    @property
    def x(self) -> AxisConfig | DirectionConfig | None:
        """The axis along x; None: off."""
        return None

    @property
    def rotation(self) -> AxisConfig | None:
        """The axis about y; None: off."""
        return None

    @property
    def limit_x_m(self) -> float:
        """The largest |δx| [m]."""
        return 0.0

    @property
    def limit_rotation_rad(self) -> float:
        """The largest |δα| [rad]."""
        return 0.0

    @property
    def tare(self) -> bool:
        """Loads count from the first reading after an axis is switched on."""
        return False

    @property
    def units(self) -> str:
        """In which b and k are given."""
        return "paper"

    @property
    def reference(self) -> ReferenceConfig | None:
        """Loads that belong to the right path; None: none do."""
        return None

    @property
    def predictor(self) -> PredictorConfig | None:
        """Compensation of the loop's delay; None: none."""
        return None

    @property
    def not_predicted(self) -> str:
        """What of it the linear analysis of its loop leaves out, in words; "" where not said."""
        return ""

    @property
    def in_space(self) -> bool:
        """It may deviate in other directions than x and pitch: a trace then has all six."""
        return False

    @property
    def beyond(self) -> str:
        """What of it is more than constant b and k on the wrench, in words; "" where nothing is.

        The loop of what is more is no point of (b, k).
        """
        return ""
