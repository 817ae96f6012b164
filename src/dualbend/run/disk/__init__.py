"""What a run leaves on disk: its folder, written whole, and read back."""
