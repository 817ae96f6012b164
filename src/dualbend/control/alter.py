"""The 28 ms command clock, the transport delay and the path modification of VAL II's ALTER.

Every discrete element of this package runs once per command period and tells its own transfer
function as ``(numerator, denominator)`` in rising powers of z⁻¹, monic denominator:
H(z) = (n₀ + n₁ z⁻¹ + …) / (1 + d₁ z⁻¹ + …).
"""

import math
from typing import Annotated, Literal

import msgspec

AlterMode = Literal["world", "tool", "tool-frozen"]


class AlterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the path modification is executed and how long it takes to get to the servos."""

    mode: Annotated[
        AlterMode,
        msgspec.Meta(
            description="axes of the deviation: world, the tool's, or the tool's as they first were"
        ),
    ] = "world"
    delay_cycles: Annotated[
        int, msgspec.Meta(ge=0, le=100, description="transport delay [command periods]")
    ] = 1


class PlanarPathModification:
    """Add a deviation to a nominal grip pose (x, z, α) in the bending frame B.

    The deviation is executed in a frame turned by φ about y_B:
    x' = x + δx cos φ, z' = z − δx sin φ, α' = α + δα, with φ = 0 in mode "world", φ = α in mode
    "tool" and φ = α at the start of ALTER in mode "tool-frozen". The last is what VAL II does: it
    does not update the tool's rotation matrix while moving (Robotics FAQ, section 12).
    The deviation is not cumulative: it is the whole deviation of this cycle.
    """

    def __init__(self, mode: AlterMode) -> None:
        self.mode: AlterMode = mode
        self._start_alpha_rad: float | None = None

    def reset(self) -> None:
        """End ALTER; the next call of `compose` starts it anew."""
        self._start_alpha_rad = None

    def compose(
        self, x_m: float, z_m: float, alpha_rad: float, dx_m: float, dalpha_rad: float
    ) -> tuple[float, float, float]:
        """Return the commanded (x [m], z [m], α [rad]) in B."""
        if self._start_alpha_rad is None:
            self._start_alpha_rad = alpha_rad
        if self.mode == "world":
            return x_m + dx_m, z_m, alpha_rad + dalpha_rad
        phi = alpha_rad if self.mode == "tool" else self._start_alpha_rad
        return (
            x_m + dx_m * math.cos(phi),
            z_m - dx_m * math.sin(phi),
            alpha_rad + dalpha_rad,
        )
