"""What the wrist sensors tell wrongly, beside noise and rounding."""

from __future__ import annotations

from dualbend.types import Config


class SensorErrors(Config):
    """What the wrist sensors tell wrongly, beside noise and rounding."""
