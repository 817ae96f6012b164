"""What happens at a time: an arm stops, a gripper fails, the sheet slips."""

from __future__ import annotations

from dualbend.types import Config


class EventsConfig(Config):
    """What happens at a time: an arm stops, a gripper fails, the sheet slips."""
