"""The motion of the block from the counts of both beats: phase, displacement, velocity and force with their noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
