"""What the robots do: the phases of an experiment."""
