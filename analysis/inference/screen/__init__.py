"""First-order scores: what a small addition to a fitted model would explain."""
