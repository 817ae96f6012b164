"""The numbers of a run: metrics, where their peaks are, and the reference solution beside them."""
