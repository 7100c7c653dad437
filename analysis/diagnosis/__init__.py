"""Closing the loop: find what the model leaves over, trace it to an effect, add it, report the error."""
