"""Linear mechanics of arms and tools: end-point stiffness, elements in series, tool inertia."""
