"""What the file of an arm does not say, as a scenario gives it in ``[robot.arm]``."""

from __future__ import annotations

from typing import Annotated

import msgspec

from dualbend.types import Config, said

_Friction = tuple[Annotated[float, msgspec.Meta(ge=0, le=1e6)], ...]
_PerJoint = tuple[Annotated[float, msgspec.Meta(gt=0, le=1e6)], ...]


class ArmFacts(Config):
    """What the file of an arm does not say; what is not given is found, computed or assumed.

    Lists have one value per joint, base to flange. A slide's are in m, N, m/s and kg.
    """

    base: (
        Annotated[
            str, said("link that stands; none: the one before the first joint", max_length=200)
        ]
        | None
    ) = None
    flange: (
        Annotated[
            str,
            said(
                "link or MJCF site that carries the tool; none: found by its name", max_length=200
            ),
        ]
        | None
    ) = None
    flange_rpy_rad: (
        Annotated[
            tuple[
                Annotated[float, msgspec.Meta(ge=-7, le=7)],
                Annotated[float, msgspec.Meta(ge=-7, le=7)],
                Annotated[float, msgspec.Meta(ge=-7, le=7)],
            ],
            said("roll, pitch, yaw of a frame with z outward in that link; none: found"),
        ]
        | None
    ) = None
    packages: (
        Annotated[
            tuple[Annotated[str, msgspec.Meta(max_length=4000)], ...],
            said(
                "folders in which the package:// folders are; none: looked for upward of the file",
                max_length=100,
            ),
        ]
        | None
    ) = None
    torque_limit_n_m: (
        Annotated[_PerJoint, said("none: as the file has it", min_length=6, max_length=8)] | None
    ) = None
    speed_limit_rad_per_s: (
        Annotated[_PerJoint, said("none: as the file has it", min_length=6, max_length=8)] | None
    ) = None
    armature_kg_m2: (
        Annotated[
            _PerJoint,
            said(
                "of the rotors at the joints; none: as the file has it, else 0.1, of a slide 10 kg",
                min_length=6,
                max_length=8,
            ),
        ]
        | None
    ) = None
    coulomb_n_m: (
        Annotated[
            _Friction,
            said(
                "dry friction of the joints; none: as the file has it", min_length=6, max_length=8
            ),
        ]
        | None
    ) = None
    viscous_n_m_s_per_rad: (
        Annotated[_Friction, said("the same, by speed", min_length=6, max_length=8)] | None
    ) = None
    payload_kg: (
        Annotated[float, said("rated; none: what the torques hold", gt=0, le=1e4)] | None
    ) = None
    reach_m: (
        Annotated[float, said("rated; none: shoulder to flange, computed", gt=0.05, le=20)] | None
    ) = None
    sha256: (
        Annotated[
            str,
            said(
                "of the file: a run writes it down, and a file changed since is refused",
                max_length=64,
            ),
        ]
        | None
    ) = None

    def over(self, below: ArmFacts) -> ArmFacts:
        """Return these facts, and those of ``below`` where these say nothing."""
        given = {key: getattr(self, key) for key in self.__struct_fields__}
        return msgspec.structs.replace(below, **{k: v for k, v in given.items() if v is not None})
