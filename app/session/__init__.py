"""A session away from the screen: its shots, settings, rig and work; no widget."""
