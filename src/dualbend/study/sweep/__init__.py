"""A scenario over many values of its keys."""
