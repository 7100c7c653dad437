"""What a small addition to a fitted model would explain, to first order."""
