"""Laws that are not in the catalogue: formulas that the user writes, and curves of one argument."""
