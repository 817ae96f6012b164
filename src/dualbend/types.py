"""Types that every package shares."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
"""Row 0 of every array over both arms is the left one."""
