"""The panels the window is composed of, one a file."""
