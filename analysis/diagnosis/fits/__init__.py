"""Hypotheses and their fits: what is searched, from where, and how likely it makes the shots."""
