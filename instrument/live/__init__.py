"""The running stream of a digitizer: its ring, the curves on the screen, the checks of a set-up."""
