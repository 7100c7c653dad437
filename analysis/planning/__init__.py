"""The shot that decides: which next shots would tell competing models apart, or a parameter better, and how surely."""
