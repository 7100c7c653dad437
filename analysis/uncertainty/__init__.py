"""The numbers of a shot and their uncertainties: budget, statistics over a series of shots, the band of the noise."""
