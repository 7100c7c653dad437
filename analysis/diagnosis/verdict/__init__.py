"""What stands: held-out shots, look-alikes, what is left over, and the criteria of it all."""
