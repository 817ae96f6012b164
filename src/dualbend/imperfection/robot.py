"""What the arms are not as their controller believes: friction, masses, joint zeros, bases."""

from __future__ import annotations

from dualbend.types import Config


class RobotErrors(Config):
    """What the arms are not as their controller believes: friction, masses, joint zeros, bases."""
