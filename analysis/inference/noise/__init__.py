"""White noise, paths that wander and frames that sway: one covariance of a displacement."""
