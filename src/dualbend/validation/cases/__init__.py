"""The cases of the validation table."""
