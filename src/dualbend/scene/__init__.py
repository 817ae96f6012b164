"""What MuJoCo simulates: arms, sheet, cell; and the inverse kinematics."""
