"""From a digitizer's samples to saved shots: read the stream, trigger, ARM, record, analyse."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
