"""A shot with its fit, and the readings that rest on a fit."""
