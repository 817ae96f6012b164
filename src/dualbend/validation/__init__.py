"""Validation: how far the simulation is from theory."""
