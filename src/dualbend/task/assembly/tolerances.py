"""How far the metrics of an assembly may be from a baseline that is first written, and why.

What the sizes lie between is said in :mod:`dualbend.check.tolerances`.
"""

_CONTACT = "contact amplifies rounding to 1e-4; other noise of the sensor moves it by 1 to 50 %"
_COUNT = "a count"
_REST = (
    "friction decides where in its clearance a hole rests: 44 or 87 µm by another BLAS's rounding"
)
_SPACING = "a tenth of what is found without misalignment"

TOLERANCES = {
    "holes_seated": ("absolute", 0.0, 0.0, _COUNT),
    "wrong_seat_checks": ("absolute", 0.0, 0.0, _COUNT),
    "retries": ("absolute", 0.0, 0.0, _COUNT),
    "worst_hole_offset": ("absolute", 1e-4, 0.0, _REST),
    "worst_hole_height": ("absolute", 5e-6, 0.0, "a hundredth of what seated allows"),
    "peak_pin_force": ("relative", 0.02, 0.05, _CONTACT),
    "peak_edge_force": ("relative", 0.02, 0.05, _CONTACT),
    "peak_penetration": ("absolute", 5e-6, 0.0, "a tenth of what is allowed"),
    "peak_impact_depth": ("absolute", 1e-4, 0.0, "an impact's speed times where in a step it is"),
    "yield_strain": ("relative", 1e-6, 0.0, "a quotient of two settings"),
    "middle_spacing_error": ("absolute", 5e-7, 0.0, _SPACING),
    "peak_moment": ("relative", 5e-3, 1e-6, _CONTACT),
    "peak_force": ("relative", 0.02, 0.05, _CONTACT),
    "peak_surface_strain": ("relative", 5e-3, 1e-8, _CONTACT),
    "simulated_time": ("absolute", 0.28, 0.0, "phases end on readings: ten cycles"),
}
