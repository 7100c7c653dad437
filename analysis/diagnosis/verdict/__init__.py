"""The verdict of a diagnosis: validation shots, look-alikes, residual tests, and the criteria that decide."""
