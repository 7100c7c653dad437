"""The paper compared with this program: its numbers, figures and simulation."""
