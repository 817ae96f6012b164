"""The flexible sheet as MuJoCo models: a chain of strips or a shell."""
