"""Fits of one shot or of several jointly: the problem, its starts, its minimum, and an effect added to it."""
