"""Estimate parameters from shots: fits, the noise model that weights them, first-order scores of further effects."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
