"""A shot with its fit, and the readings that come from a fit."""
