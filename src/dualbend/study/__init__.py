"""Studies of many runs: sweep, robustness, onset of oscillation, the paper's figures."""
