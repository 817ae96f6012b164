"""Reports of runs: HTML page, comparison of two runs, figures."""
