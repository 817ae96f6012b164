"""Assemblies of many sheets that differ: a Monte Carlo study."""
