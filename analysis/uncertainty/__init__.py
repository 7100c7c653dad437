"""The numbers of a shot and their uncertainties: budget, statistics over a series of shots, and noise band."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
