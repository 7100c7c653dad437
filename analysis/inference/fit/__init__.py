"""Fit models to one shot or to several shots jointly."""
