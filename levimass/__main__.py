"""``python -m levimass`` is ``levimass``."""

from levimass import _main

if __name__ == "__main__":
    raise SystemExit(_main())
