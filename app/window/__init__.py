"""The desktop window: panels, plots, and presenters that connect them with the session."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
