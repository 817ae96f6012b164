"""The rod between two grips: the planar solver, Kirchhoff's rod in space, the rod that yields."""
