"""Read, with checks, and write, crash-safe: recordings, motion records, laws and files of other programs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
