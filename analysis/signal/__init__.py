"""Demodulation: the block's displacement, velocity and force, with their noise, from the counts of both beats."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
