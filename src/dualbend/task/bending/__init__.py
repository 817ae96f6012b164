"""Bending along a path between two grips."""
