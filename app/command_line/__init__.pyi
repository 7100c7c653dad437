from .cli import main, window
from .machine import TRY_WINDOW, try_window

__all__ = [
    "TRY_WINDOW",
    "main",
    "try_window",
    "window",
]
