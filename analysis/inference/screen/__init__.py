"""First-order scores: how much of a fit's residual each further effect would explain."""
