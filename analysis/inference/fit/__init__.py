"""Models fitted to one shot or to several at once."""
