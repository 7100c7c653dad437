"""What a fit leaves: tests of its residual, predictions of validation shots, and how well effects can be told apart."""
