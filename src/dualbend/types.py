"""Types that every package shares: vectors, the two sides, the sections of a scenario."""

from typing import Any, Literal, dataclass_transform

import msgspec
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

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
    ) -> "_Strict":
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
