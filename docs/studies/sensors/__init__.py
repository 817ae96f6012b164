"""How well a cell can know what its wrist sensors tell wrongly."""
