"""Analyse thousands of shots in parallel, on one or several machines, with a journal to resume from."""
