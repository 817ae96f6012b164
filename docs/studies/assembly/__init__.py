"""What an assembly bears: faults in every phase, gross errors, other sheets, pins and arms."""
