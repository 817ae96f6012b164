"""The assembly bed with its pins, the pick-up stand, and contact between holes and pins."""
