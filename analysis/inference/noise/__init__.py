"""The noise covariance of a displacement: white noise, wander of the optical path, motion of the frame."""
