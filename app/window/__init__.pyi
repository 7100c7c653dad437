from .controls.theme import LIGHT
from .main_window import run
from .plots.save import save_png, save_svg

__all__ = [
    "LIGHT",
    "run",
    "save_png",
    "save_svg",
]
