"""Metrics of runs against a baseline."""
