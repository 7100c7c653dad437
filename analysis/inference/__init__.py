"""Parameters from shots: fits, the noise that they are weighed with, and first-order scores of what may be added."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
