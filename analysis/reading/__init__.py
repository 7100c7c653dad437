"""Read the numbers of an impact from the motion, without a plate model: flights, contact edges, bounces, pulse."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
