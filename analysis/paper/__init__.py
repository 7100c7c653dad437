"""The paper beside this program: its numbers, figures and simulation, audited."""
