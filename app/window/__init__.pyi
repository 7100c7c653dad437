from .controls.theme import LIGHT as LIGHT
from .main_window import run as run
from .plots.save import save_png as save_png
from .plots.save import save_svg as save_svg
