"""The digitizer and long computations in subprocesses, and the messages between the processes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
