"""Presenters: each stands between one part of the session and the panels that show it."""
