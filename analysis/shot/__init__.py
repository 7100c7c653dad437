"""The parts of a shot: recording, motion, impact, fit, and quantities with units and uncertainties."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
