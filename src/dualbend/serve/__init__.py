"""The cell as a server: its arms and sensors speak the protocols of real ones."""
