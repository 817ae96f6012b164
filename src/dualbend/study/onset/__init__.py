"""Onset of oscillation: prediction against the full simulation."""
