"""Recordings for the rerun viewer, pictures and videos of a run."""
