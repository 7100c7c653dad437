from .cli import main
from .machine import TRY_WINDOW, try_window
from .modes import window

__all__ = [
    "TRY_WINDOW",
    "main",
    "try_window",
    "window",
]
