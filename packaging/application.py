"""What the frozen application runs: the window, or whatever its command line asks for."""

import multiprocessing
import sys
from pathlib import Path

from app.command_line.machine import TRY_WINDOW, try_window
from levimass import _main, _window

if __name__ == "__main__":
    multiprocessing.freeze_support()  # a child is this program once more
    if sys.argv[1:] == [TRY_WINDOW]:
        raise SystemExit(try_window())
    raise SystemExit(_window() if Path(sys.executable).stem.endswith("-window") else _main())
