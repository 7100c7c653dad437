"""What the frozen application runs: the window, or whatever its command line asks for."""

import multiprocessing

from levimass import _main

if __name__ == "__main__":
    multiprocessing.freeze_support()  # a child is this program once more
    raise SystemExit(_main())
