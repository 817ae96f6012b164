"""Robot arms: models from MJCF or URDF, kinematics, placement and joint limits."""
