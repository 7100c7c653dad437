"""What a first start costs beside every later one: ``python -m tests.benchmarks.first_start``.

In a fresh cache: one simulated shot, to its readings and to its fit, then everything by as many processes as there are
cores, then the same once more from the cache.  ``cold / warm`` is the ratio to watch; seconds depend on the machine.
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
from app.session.kernels import prepare
if __name__ == '__main__':
    assert prepare(lambda *_: None, lambda: False)
"""


def main() -> int:
    """Measure and print."""
    with tempfile.TemporaryDirectory(prefix="levimass-cold-") as folder:
        cold, warm = _seconds(_SHOT, folder), _seconds(_SHOT, folder)
        _tell("the readings of one shot", cold[0], warm[0])
        _tell("and its fit", cold[1], warm[1])
    with tempfile.TemporaryDirectory(prefix="levimass-cold-") as folder:
        cold, warm = _seconds(_EVERYTHING, folder), _seconds(_EVERYTHING, folder)
        _tell(f"everything, {os.cpu_count()} processes", cold[1], warm[1])
    return 0


def _tell(what: str, cold: float, warm: float) -> None:
    print(f"{what:28s} cold {cold:6.1f} s, warm {warm:5.1f} s, cold / warm {cold / warm:5.1f}", flush=True)


def _seconds(code: str, folder: str) -> tuple[float, float]:
    """Return how long a program takes to its first words and to its end, whose kernels are kept in ``folder``."""
    with tempfile.NamedTemporaryFile("w", suffix=".py") as script:  # a file: its children import it once more
        script.write(code)
        script.flush()
        began = time.perf_counter()
        environment = os.environ | {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": os.getcwd()}
        with subprocess.Popen([sys.executable, script.name], env=environment, stdout=subprocess.PIPE) as program:
            assert program.stdout is not None
            program.stdout.readline()
            first_words = time.perf_counter() - began
            program.stdout.read()
        if program.returncode:
            raise subprocess.CalledProcessError(program.returncode, code)
        return first_words, time.perf_counter() - began


if __name__ == "__main__":
    raise SystemExit(main())
