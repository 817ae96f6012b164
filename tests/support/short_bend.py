"""Settings of a bend that is over in a second."""

SHORT = (
    "path.end_rad=0.3",
    "motion.speed_rad_per_s=1.0",
    "motion.settle_s=0.2",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)
