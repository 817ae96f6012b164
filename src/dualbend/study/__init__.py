"""Studies of many runs: sweep, robustness, tuning, onset of oscillation, the paper's figures."""
