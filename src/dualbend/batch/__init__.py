"""Many worlds at once: cells that differ in numbers, advanced together."""
