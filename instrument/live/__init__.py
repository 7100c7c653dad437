"""What the screen sees of a running digitizer: snapshots, signals, and the checks of a set-up."""
