"""The parts of a shot: recording, motion, impact, fit, and quantities with units and uncertainties."""
