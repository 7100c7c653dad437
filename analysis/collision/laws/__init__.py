"""Laws outside the catalogue: formulas written by the user, and curves of one argument."""
