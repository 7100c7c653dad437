"""A slider driven by a measured force: its mass, drag and further laws by regression, and its repeatability."""
