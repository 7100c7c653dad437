"""Search of the catalogue: score every effect, and fit the best jointly."""
