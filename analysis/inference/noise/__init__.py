"""The covariance of a displacement's noise: white noise, wandering optical paths, motion of the frame."""
