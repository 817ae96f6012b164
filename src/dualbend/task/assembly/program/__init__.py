"""The robots' program: a table of phases and steps, and how it is executed."""
