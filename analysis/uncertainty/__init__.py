"""What a standard uncertainty holds: budget, consistency over a series of shots, the band of the noise."""
