"""The command ``levimass`` and its modes; none but the window needs Qt."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
