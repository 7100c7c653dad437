"""Strengths of white noise and random motion in residuals, with free parameters besides."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
