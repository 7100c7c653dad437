"""What moves without a law: the floor of a whole shot, the building it stands in, lines."""
