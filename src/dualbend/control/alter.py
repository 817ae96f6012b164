"""The path modification of VAL II's ALTER: how a deviation of the nominal path is executed."""

from typing import Annotated, Literal

import numpy as np

from dualbend.errors import InputError
from dualbend.mechanics.coupling import deviation_angle
from dualbend.types import Config, PlanarPose, Vector, said

AlterMode = Literal["world", "tool", "tool-frozen"]


class AlterConfig(Config):
    """How the path modification is executed and how long it takes to get to the servos."""

    mode: Annotated[
        AlterMode,
        said("axes of the deviation: world, the tool's, or the tool's as they first were"),
    ] = "world"
    delay_cycles: Annotated[int, said("transport delay [command periods]", ge=0, le=100)] = 1


def refuse_out_of_plane(deviation: Vector) -> None:
    """Raise InputError where a deviation (..., 6) has a part along y, in roll or in yaw."""
    if np.count_nonzero(deviation[..., 1::2]):
        raise InputError(
            "a deviation along y, in roll or in yaw cannot be executed: the commanded poses "
            "are in the bending plane; need 0 in components 1, 3 and 5"
        )


class PlanarPathModification:
    """Add a deviation to a nominal grip pose (x, z, α) in the bending frame B.

    The deviation is executed in a frame turned by φ about y_B:
    x' = x + δx cos φ + δz sin φ, z' = z − δx sin φ + δz cos φ, α' = α + δα, with φ = 0 in mode
    "world", φ = α in mode "tool" and φ = α at the start of ALTER in mode "tool-frozen". The last is
    what VAL II does: it does not update the tool's rotation matrix while moving (Robotics FAQ,
    section 12). The deviation is not cumulative: it is the whole deviation of this cycle. ALTER
    starts with the first call of `compose`.
    """

    def __init__(self, mode: AlterMode) -> None:
        self.mode: AlterMode = mode
        self._start_alpha_rad: Vector | None = None

    def compose(self, nominal: PlanarPose, deviation: Vector) -> PlanarPose:
        """Return the commanded pose (..., 3) of a nominal one and a deviation (..., 6).

        Raises
        ------
        InputError
            The deviation has a part out of the bending plane: along y, in roll or in yaw.
        """
        refuse_out_of_plane(deviation)
        planar = deviation[..., ::2]
        if self._start_alpha_rad is None:
            self._start_alpha_rad = nominal.alpha_rad
        if self.mode == "world":
            return PlanarPose(nominal.coordinates + planar)
        phi = deviation_angle(self.mode, nominal.alpha_rad, self._start_alpha_rad)
        c, s = np.cos(phi), np.sin(phi)
        turned = planar.copy()
        turned[..., 0] = planar[..., 0] * c + planar[..., 1] * s
        turned[..., 1] = planar[..., 1] * c - planar[..., 0] * s
        return PlanarPose(nominal.coordinates + turned)
