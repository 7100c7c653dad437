"""The equations of motion of a collision, with effects and laws, and their exact solution."""
