"""What a first start costs beside every later one: ``python -m tests.benchmarks.first_start``.

In a fresh cache: one simulated shot with its numbers, then everything by as many processes as there are cores, then
the same shot once more from the cache.  ``cold / warm`` is the ratio to watch; seconds depend on the machine.
"""

import os
import subprocess
import sys
import tempfile
import time

_SHOT = """
from app.command_line.start import headless_shot
if __name__ == '__main__':
    assert headless_shot() == 0
"""
_EVERYTHING = """
from app.session.prepare import prepare
if __name__ == '__main__':
    assert prepare(lambda *_: None, lambda: False)
"""


def main() -> int:
    """Measure and print."""
    with tempfile.TemporaryDirectory(prefix="levimass-cold-") as folder:
        cold, warm = _seconds(_SHOT, folder), _seconds(_SHOT, folder)
        _tell("one shot with its numbers", cold, warm)
    with tempfile.TemporaryDirectory(prefix="levimass-cold-") as folder:
        cold, warm = _seconds(_EVERYTHING, folder), _seconds(_EVERYTHING, folder)
        _tell(f"everything, {os.cpu_count()} processes", cold, warm)
    return 0


def _tell(what: str, cold: float, warm: float) -> None:
    print(f"{what:28s} cold {cold:6.1f} s, warm {warm:5.1f} s, cold / warm {cold / warm:5.1f}", flush=True)


def _seconds(code: str, folder: str) -> float:
    """Return how long a program takes whose kernels are kept in ``folder``."""
    with tempfile.NamedTemporaryFile("w", suffix=".py") as script:  # a file: its children import it once more
        script.write(code)
        script.flush()
        began = time.perf_counter()
        environment = os.environ | {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": os.getcwd()}
        subprocess.run([sys.executable, script.name], env=environment, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - began


if __name__ == "__main__":
    raise SystemExit(main())
