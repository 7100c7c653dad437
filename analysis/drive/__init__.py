"""A slider driven by a measured force: its mass, drag and other laws by regression, and its repeatability."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
