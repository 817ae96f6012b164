"""Many closed loops at once: the same objects as of a single run, with an axis of worlds."""
