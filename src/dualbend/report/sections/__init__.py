"""Sections that a report of any task can have."""
