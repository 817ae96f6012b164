"""Types that every package shares."""

from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
"""Row 0 of every array over both arms is the left one."""


class Tagged(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"
):
    """A section of a scenario that is one of several kinds, which its key ``kind`` names."""

    @property
    def kind(self) -> str:
        """The kind, as the scenario names it."""
        return str(self.__struct_config__.tag)
