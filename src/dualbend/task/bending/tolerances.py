"""How far the metrics of bending may be from a baseline that is first written, and why.

What the sizes lie between is said in :mod:`dualbend.check.tolerances`.
"""

_SMOOTH = "rounding moves it by 1e-10, a tap or a cycle of delay more by 6e-3 or more in fig8"
_HELD = "a small rest of large moments; a rounding moves it as it moves them"
_ACROSS = "as much as the peak force; no shipped scenario is misaligned, so not measured there"
_FITTED = "a window that a rounding adds or takes away moves the best one by a row"

TOLERANCES = {
    "peak_moment": ("relative", 2e-3, 1e-6, _SMOOTH),
    "rms_moment": ("relative", 2e-3, 1e-6, _SMOOTH),
    "peak_moment_by_piece": ("relative", 2e-3, 1e-6, _SMOOTH),
    "mean_moment_hold": ("relative", 0.02, 1e-5, _HELD),
    "peak_force": ("relative", 5e-3, 1e-3, _SMOOTH),
    "peak_lateral_force": ("relative", 5e-3, 1e-6, _ACROSS),
    "peak_twist_moment": ("relative", 5e-3, 1e-6, _ACROSS),
    "peak_yaw_moment": ("relative", 5e-3, 1e-6, _ACROSS),
    "peak_deviation_x": ("relative", 2e-3, 1e-9, _SMOOTH),
    "peak_deviation_alpha": ("relative", 2e-3, 1e-9, _SMOOTH),
    "permanent_curvature": ("relative", 5e-3, 1e-6, _SMOOTH),
    "permanent_end_slope": ("relative", 5e-3, 1e-6, _SMOOTH),
    "curvature_before_release": ("relative", 2e-3, 1e-6, _SMOOTH),
    "peak_surface_strain": ("relative", 2e-3, 1e-8, _SMOOTH),
    "oscillation": ("relative", 5e-3, 1e-6, _SMOOTH),
    "oscillation_frequency": ("relative", 0.02, 0.1, _FITTED),
    "oscillation_growth": ("relative", 0.1, 0.2, _FITTED),
}
