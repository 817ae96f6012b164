"""What MuJoCo simulates: cell, sheet and bed; inverse kinematics and the only physics stepper."""
