from .cli import main as main
from .cli import window as window
from .machine import TRY_WINDOW as TRY_WINDOW
from .machine import try_window as try_window
