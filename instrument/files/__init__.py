"""Files, checked when read and written safe from a crash: recordings, motion records, laws, foreign formats."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
