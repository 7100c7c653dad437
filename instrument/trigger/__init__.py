"""Where a shot begins in a stream of counts: a step of the light switch, or the block that starts to move."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
