"""The exact solution of a collision: its equations of motion, their propagation, and derivatives by every parameter."""
