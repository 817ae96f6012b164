"""Gains that are searched for by simulation, and what keeps them from doing more."""
