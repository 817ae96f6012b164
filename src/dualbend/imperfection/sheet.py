"""What the sheet is not as everybody in the cell believes."""

from __future__ import annotations

from dualbend.types import Config


class SheetErrors(Config):
    """What the sheet is not as everybody in the cell believes."""
