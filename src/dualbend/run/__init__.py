"""A run: the command loop, its cell, its trace and what it leaves on disk."""
