"""The sheets that several tests speak of."""

from dualbend.beam.sheet import Sheet

STRIP = Sheet(
    length_m=0.4,
    width_m=0.057,
    thickness_m=0.0005,
    young_pa=70.3e9,
    poisson_ratio=0.33,
    density_kg_per_m3=2680,
)
"""Aluminium 5052-H32: that of the shipped scenarios."""

PANEL = Sheet(
    length_m=0.6,
    width_m=0.2,
    thickness_m=0.5e-3,
    young_pa=70e9,
    poisson_ratio=0.33,
    density_kg_per_m3=2700.0,
)
"""A wider and longer one, whose weight counts."""
