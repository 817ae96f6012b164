"""Stability of the compliance, predicted before a run: loop, margins, map."""
