"""What the command link does wrong, and what the robot controller does then."""

from __future__ import annotations

from dualbend.types import Config


class LinkConfig(Config):
    """What the command link does wrong, and what the robot controller does then."""
