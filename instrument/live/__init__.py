"""The running stream of a digitizer: its ring buffer, the live curves, the checks of the set-up."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
