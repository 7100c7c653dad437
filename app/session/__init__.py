"""The session logic behind the window: shots, settings, rig and background jobs; no Qt."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
