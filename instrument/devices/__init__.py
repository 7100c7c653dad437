"""Digitizers: their common interface, the drivers, and how a digitizer is named, found and opened."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
