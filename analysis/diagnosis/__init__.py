"""Diagnose a fit: find the effect or law that explains the model's residual; report errors before and after."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
