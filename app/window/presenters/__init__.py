"""Presenters: each connects one part of the session or the rig with its panels."""
