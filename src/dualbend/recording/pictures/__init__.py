"""Pictures and videos of a run or an arm, drawn by MuJoCo without a screen."""
