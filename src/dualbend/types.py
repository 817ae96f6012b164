"""Types that every package shares: vectors, the two sides, sections, planar poses and wrenches.

An arm's bending frame B has its origin on the floor in the mid-plane between the arms, z up and x
towards the other arm; the right arm's is the left arm's turned by π about z. The grip frame G has
its origin at the gripper centre and x into the sheet: G is B turned by the end slope α about y.
"""

from __future__ import annotations

from typing import Any, Literal, dataclass_transform

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]
Reals = float | Vector
"""One number, or one for each of a leading shape."""

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
"""Row 0 of every array over both arms is the left one."""


class _Strict(msgspec.StructMeta):
    """Structs frozen, given by name and without unknown keys, unless they say otherwise."""

    def __new__(
        mcs,
        name: str,
        bases: tuple[type, ...],
        body: dict[str, Any],
        **options: Any,  # noqa: ANN401 - msgspec's own
    ) -> _Strict:
        strict = {"frozen": True, "kw_only": True, "forbid_unknown_fields": True}
        return super().__new__(mcs, name, bases, body, **{**strict, **options})


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(msgspec.field,))
class Config(msgspec.Struct, frozen=True, metaclass=_Strict):
    """A section of a scenario, or of another file that a user writes."""


class Tagged(Config, tag_field="kind"):
    """A section of a scenario that is one of several kinds, which its key ``kind`` names."""

    @property
    def kind(self) -> str:
        """The kind, as the scenario names it."""
        return str(self.__struct_config__.tag)


def said(description: str, **bounds: Any) -> msgspec.Meta:  # noqa: ANN401 - msgspec's own
    """Return what stands beside the type of a key: what it is, and what :class:`msgspec.Meta` has.

    ``length_m: Annotated[float, said("free length between the grips", ge=0.05, le=3.0)]``
    """
    return msgspec.Meta(description=description, **bounds)


Frame = Literal["sensor", "grip", "bending"]
Point = Literal["sensor", "grip", "middle"]


def indices(given: ArrayLike) -> NDArray[np.intp]:
    """Return indices of the type that ``take`` wants: others it converts in each call."""
    return np.asarray(given, dtype=np.intp)


def matvec(matrix: Vector, vector: Vector) -> Vector:
    """Return M v (..., m) of matrices (..., m, n) and vectors (..., n), each product by itself.

    The leading shape changes no bit of any product, as it does where a stack of vectors makes one
    large matrix product.
    """
    product: Vector = np.matmul(matrix, vector[..., np.newaxis])[..., 0]
    return product


class PlanarPose(msgspec.Struct, frozen=True):
    """Pose of a grip in the bending plane: ``coordinates`` (..., 3) are x, z [m] and α [rad]."""

    coordinates: Vector

    @classmethod
    def of(cls, x_m: Reals, z_m: Reals, alpha_rad: Reals) -> PlanarPose:
        """Return the pose of coordinates (...), broadcast against each other."""
        return cls(np.stack(np.broadcast_arrays(x_m, z_m, alpha_rad), axis=-1, dtype=np.float64))

    @property
    def x_m(self) -> Vector:
        """Place along x (...) [m]; negative in the arm's own bending frame."""
        return self.coordinates[..., 0]

    @property
    def z_m(self) -> Vector:
        """Height (...) [m]."""
        return self.coordinates[..., 1]

    @property
    def alpha_rad(self) -> Vector:
        """End slope (...) [rad]."""
        return self.coordinates[..., 2]


class Wrench(msgspec.Struct, frozen=True):
    """Force and torque on an arm: ``components`` (..., 6) are F x, y, z [N], then M x, y, z [N m].

    ``frame`` says along which axes they are told, ``point`` about which point the torque is: the
    sensor's origin, the gripper centre or the middle between both grips.
    """

    components: Vector
    frame: Frame
    point: Point

    @classmethod
    def of(cls, force_n: Vector, torque_nm: Vector, frame: Frame, point: Point) -> Wrench:
        """Return the wrench of a force and a torque (..., 3)."""
        return cls(np.concatenate((force_n, torque_nm), axis=-1, dtype=np.float64), frame, point)

    @property
    def force_n(self) -> Vector:
        """Force (..., 3) [N]."""
        return self.components[..., :3]

    @property
    def torque_nm(self) -> Vector:
        """Torque (..., 3) [N m]."""
        return self.components[..., 3:]

    @property
    def planar(self) -> Vector:
        """What bends the sheet: F_x, F_z [N] and M_y [N m] (..., 3)."""
        return self.components[..., ::2]

    def part(self, index: int) -> Wrench:
        """Return one of the wrenches along the first axis."""
        return Wrench(self.components[index], self.frame, self.point)

    def moved(self, lever_m: Vector, point: Point) -> Wrench:
        """Tell the torque about another point: M' = M − r × F (paper, Fig. 7, in words).

        Parameters
        ----------
        lever_m
            r (..., 3) [m], from the old point to the new one, along the axes of ``frame``.
        point
            Name of the new point.
        """
        torque = self.torque_nm - np.cross(lever_m, self.force_n)
        return Wrench.of(self.force_n, torque, self.frame, point)

    def turned(self, rotation: Vector, frame: Frame) -> Wrench:
        """Tell it along other axes; ``rotation`` (..., 3, 3) takes old components to new ones."""
        both = self.components.reshape(*self.components.shape[:-1], 2, 3)
        turned = both @ rotation.mT
        return Wrench(turned.reshape(self.components.shape), frame, self.point)

    def in_bending_frame(self, alpha_rad: Reals) -> Wrench:
        """Turn from the grip frame to the bending frame, by the end slope (...) about their y.

        F_x' = F_x cos α + F_z sin α is horizontal, F_z' = F_z cos α − F_x sin α vertical; the
        torque turns as the force does.

        Raises
        ------
        ValueError
            It is not told in the grip frame.
        """
        if self.frame != "grip":
            raise ValueError(f"a wrench along the axes of {self.frame!r}; needs 'grip'")
        sine = np.sin(alpha_rad)
        rotation = np.zeros((*sine.shape, 3, 3))
        rotation[..., 0, 0] = rotation[..., 2, 2] = np.cos(alpha_rad)
        rotation[..., 0, 2], rotation[..., 2, 0] = sine, -sine
        rotation[..., 1, 1] = 1.0
        return self.turned(rotation, "bending")
