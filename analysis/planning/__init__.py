"""Plan the next shots: those that would separate competing models, or reduce a parameter's uncertainty."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
