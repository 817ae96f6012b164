"""Linear mechanics of two arms with tools: end-point compliance, series, tool inertia, coupling."""
