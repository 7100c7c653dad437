"""Learning laws outside the catalogue: free curves, their closed forms, and the laws as results."""
