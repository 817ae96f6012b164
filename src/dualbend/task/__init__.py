"""What the robots do: bending and assembly."""
