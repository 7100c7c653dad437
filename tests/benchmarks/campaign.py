"""What a campaign makes of more processes: ``python -m tests.benchmarks.campaign [--shots N]``.

Shots are simulated, then analysed by one process (``--replay``) and by ``--jobs 1`` and ``--jobs 2``.  Each way is
timed on a few and on all shots: the difference is what a shot costs once everything is loaded.  Target: the throughput
a core is within 10 % of one process's (as far as there are cores).
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FEW = 4


def main(arguments: list[str] | None = None) -> int:
    """Measure; return 1 when the target is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shots", type=int, default=40)
    shots = parser.parse_args(arguments).shots
    with tempfile.TemporaryDirectory(prefix="levimass-campaign-") as name:
        folder = Path(name)
        for part, count in (("few", FEW), ("more", shots - FEW)):
            _levimass("--simulate", str(folder / "all" / part), "--shots", str(count), "--seed", str(count))
        _timed(folder, "all", [])  # kernels loaded, files in memory
        alone = _a_shot(folder, shots, [])
        print(f"one process         {1 / alone:6.2f} shots a second")
        worst = 1.0
        for jobs in (1, 2):
            seconds = _a_shot(folder, shots, ["--jobs", str(jobs)])
            share = alone / (jobs * seconds)
            worst = min(worst, share)
            print(
                f"--jobs {jobs}            {1 / seconds:6.2f} shots a second, {share:.2f} of that a core (target 0.90)"
            )
    return int(worst < 0.9)


def _a_shot(folder: Path, shots: int, how: list[str]) -> float:
    """Return the seconds that a shot costs beside what the start costs."""
    return (_timed(folder, "all", how) - _timed(folder, "all/few", how)) / (shots - FEW)


def _timed(folder: Path, part: str, how: list[str]) -> float:
    with tempfile.TemporaryDirectory(dir=folder) as out:
        began = time.perf_counter()
        _levimass("--replay", str(folder / part), "--no-diagnose", "--json", str(Path(out) / "result.json"), *how)
        return time.perf_counter() - began


def _levimass(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "app", *arguments], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    raise SystemExit(main())
