"""The session without its screen: shots, settings, rig and background work; no Qt."""
