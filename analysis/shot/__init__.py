"""What a shot is: recording, motion, impact, fit, numbers with their units and uncertainties."""
