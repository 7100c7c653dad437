"""Background work: the worker thread and the worker process; nothing else here or in ``app`` starts either."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
