"""What the frozen application runs: the window, or whatever its command line asks for."""

import multiprocessing
import sys
from pathlib import Path

from app.command_line import TRY_WINDOW, main, try_window, window

if __name__ == "__main__":
    multiprocessing.freeze_support()  # a child is this program once more
    if sys.argv[1:] == [TRY_WINDOW]:
        raise SystemExit(try_window())
    raise SystemExit(window() if Path(sys.executable).stem.endswith("-window") else main())
