"""Equations of motion of a collision and their exact solution, effects and laws included."""
