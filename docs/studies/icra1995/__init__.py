"""The audit of the paper."""
