"""Memory that a process has and does not use."""

from __future__ import annotations

import ctypes
from contextlib import suppress


def give_back() -> None:
    """Let glibc give what is free between what is used back to the system.

    Of the states of MuJoCo that worlds had one after the other it would keep half a megabyte each.
    With other libraries there is nothing to ask.
    """
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
