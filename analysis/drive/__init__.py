"""A driven slider: what force a motion takes, which laws of the drive show in it, and what the drive repeats to."""
