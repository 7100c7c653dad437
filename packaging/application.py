"""What the frozen application runs: the window, or whatever its command line asks for."""

import multiprocessing
import sys
from pathlib import Path

from levimass import _main, _window

if __name__ == "__main__":
    multiprocessing.freeze_support()  # a child is this program once more
    raise SystemExit(_window() if Path(sys.executable).stem.endswith("-window") else _main())
