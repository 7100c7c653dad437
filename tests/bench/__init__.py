"""Blind sets of the simulated bench, and how far apart their effects lie: for tests and benchmarks alone."""
