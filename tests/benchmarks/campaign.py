"""What a campaign makes of more processes: ``python -m tests.benchmarks.campaign [--shots N] [--many N]``.

Shots are simulated, then analysed by one process (``--replay``) and by ``--jobs 1`` and ``--jobs 2``.  Each way is
timed on a few and on all shots: the difference is what a shot costs once everything is loaded.  Target: the throughput
a core is within 10 % of one process's.  What counts is processor time, of all processes together: by the clock one
process is helped by the second core, and all are held up by whatever else runs on the machine.

Then ``--many`` shots (2,000), links to one exported motion record of which every tenth sample is kept, go through one
campaign, each read and fitted: the memory of the process that hands them out may not grow with their number (target:
below 20 MB more than for a tenth of them).
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

FEW = 4
MAX_GROWTH_MB = 20.0
_TELLS_MEMORY = """
import resource, sys
from app.command_line.cli import main
status = main(sys.argv[1:])
print("most", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)
sys.exit(status)
"""


def main(arguments: list[str] | None = None) -> int:
    """Measure; return 1 when a target is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shots", type=int, default=40)
    parser.add_argument("--many", type=int, default=2000)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="levimass-campaign-") as name:
        folder = Path(name)
        missed = _throughput(folder, options.shots)
        return int(_driver_memory(folder, options.many) or missed)


def _throughput(folder: Path, shots: int) -> bool:
    """Compare processes; return whether the target was missed."""
    for part, count in (("few", FEW), ("more", shots - FEW)):
        _levimass("--simulate", str(folder / "all" / part), "--shots", str(count), "--seed", str(count))
    _timed(folder, "all", [])  # kernels loaded, files in memory
    alone = _a_shot(folder, shots, [])
    print(f"one process  {1e3 * alone.cpu_s:6.0f} ms of a core a shot, {1 / alone.clock_s:6.2f} shots a second")
    worst = 1.0
    for jobs in (1, 2):
        here = _a_shot(folder, shots, ["--jobs", str(jobs)])
        share = alone.cpu_s / here.cpu_s
        worst = min(worst, share)
        print(
            f"--jobs {jobs}     {1e3 * here.cpu_s:6.0f} ms of a core a shot, {1 / here.clock_s:6.2f} shots a second; "
            f"throughput a core {share:.2f} of one process's (target 0.90)"
        )
    return worst < 0.9


def _driver_memory(folder: Path, many: int) -> bool:
    """Hand out many shots; return whether the memory of who does it grew with them."""
    _levimass("--replay", str(folder / "all" / "few"), "--no-diagnose", "--export", str(folder / "csv"))
    head, *rows = sorted((folder / "csv").glob("shot-*.csv"))[0].read_text().splitlines(keepends=True)
    record = folder / "csv" / "thinned.csv"
    record.write_text(head + "".join(rows[::10]))
    mass_kg = 17.85e-3  # of the simulated bench
    most_mb = []
    for count in (many // 10, many):
        place = folder / f"many-{count}"
        place.mkdir()
        for n in range(count):
            os.link(record, place / f"m{n}.csv")
            (place / f"m{n}.toml").write_text(f'model = "plate"\nmoving_mass_kg = {mass_kg}\n')
        began, before = time.perf_counter(), _children_s()
        ran = subprocess.run(
            [sys.executable, "-c", _TELLS_MEMORY, "--replay", str(place), "--jobs", "2", "--json", f"{place}.json"],
            check=False, capture_output=True, text=True,
        )  # fmt: skip
        spent, cpu_s = time.perf_counter() - began, _children_s() - before
        most_mb.append(int(ran.stderr.split()[-1]) / 1024)
        print(
            f"{ran.stdout.strip()}: {count / spent:.2f} a second, {1e3 * cpu_s / count:.0f} ms of a core each, "
            f"driver {most_mb[-1]:.0f} MB at most",
            flush=True,
        )
    growth = most_mb[1] - most_mb[0]
    print(f"{many} shots instead of {many // 10}: {growth:+.1f} MB (target below {MAX_GROWTH_MB:g})")
    return growth > MAX_GROWTH_MB


@dataclass(frozen=True, slots=True)
class Spent:
    """Time by the clock, and of processors in all processes, in s."""

    clock_s: float
    cpu_s: float


def _a_shot(folder: Path, shots: int, how: list[str]) -> Spent:
    """Return what a shot costs beside what the start costs."""
    whole, start = _timed(folder, "all", how), _timed(folder, "all/few", how)
    more = shots - FEW
    return Spent((whole.clock_s - start.clock_s) / more, (whole.cpu_s - start.cpu_s) / more)


def _timed(folder: Path, part: str, how: list[str]) -> Spent:
    with tempfile.TemporaryDirectory(dir=folder) as out:
        began, before = time.perf_counter(), _children_s()
        _levimass("--replay", str(folder / part), "--no-diagnose", "--json", str(Path(out) / "result.json"), *how)
        return Spent(time.perf_counter() - began, _children_s() - before)


def _children_s() -> float:
    """Return the processor time of all processes that were started and have ended, theirs included."""
    spent = os.times()
    return spent.children_user + spent.children_system


def _levimass(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "app", *arguments], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    raise SystemExit(main())
