"""Sheets one after another, each corrected by what the ones before it taught."""
