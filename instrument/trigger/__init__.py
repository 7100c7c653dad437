"""Triggers: find the start of a shot in a stream of counts, by the light switch or by the motion of the block."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
