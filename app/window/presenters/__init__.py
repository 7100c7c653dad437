"""Presenters, each of which connects one part of the session with its panels."""
