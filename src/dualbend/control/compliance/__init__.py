"""Compliance: what turns a measured wrench into a deviation of the commanded pose."""
