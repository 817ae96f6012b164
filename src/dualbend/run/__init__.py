"""A run: its scenario, the loop, what it leaves behind."""
