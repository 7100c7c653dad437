"""Analyse thousands of shots in several processes or machines, with a journal from which a stopped call resumes."""
