"""Mechanics of the sheet: material, section, elastica, rods, and the paths of its grips."""
