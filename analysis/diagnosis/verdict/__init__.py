"""The verdict: held-out shots, look-alikes, residuals, and the criteria that decide."""
