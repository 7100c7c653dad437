"""The command ``levimass`` and its modes; only the window and the paper's figures need Qt."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
