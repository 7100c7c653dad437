"""Read the numbers of an impact from the motion alone, without a model of the plate: flights, edges, bounces, pulse."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
