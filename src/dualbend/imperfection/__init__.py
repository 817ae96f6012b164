"""What real arms, sensors, links and sheets do wrong: seeded, each by itself, none by default."""
