"""What a low-pass filter costs of the stable gain."""
