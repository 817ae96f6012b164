"""How a run may end before its motion does."""

from __future__ import annotations


class TaskStopped(Exception):  # noqa: N818 - an outcome of a run
    """The robots give up, safely; the message says in which phase and why."""
