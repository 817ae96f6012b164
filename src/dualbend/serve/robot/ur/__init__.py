"""UR's Real-Time Data Exchange (RTDE), and what goes with it on a UR robot."""
