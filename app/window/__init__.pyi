from .main_window import run
from .plots.save import save_png, save_svg
from .theme import LIGHT

__all__ = [
    "LIGHT",
    "run",
    "save_png",
    "save_svg",
]
