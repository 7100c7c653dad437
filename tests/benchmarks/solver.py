"""Time every path of the solver, against an earlier version of the program where one is given.

``python -m tests.benchmarks.solver [FOLDER]``: FOLDER holds a checkout of another version.  Both are asked in turns,
each in a process of its own, for one collision of 60 ms at 100 kS/s by every way through the solver.  Printed are
processor times of this version, the ratio other/this, and by how much the displacements differ.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROUNDS, AT_ONCE = 15, 4
TIME_S = np.arange(-1500, 4500) * 1e-5 - 3.3e-6
SCREENED_S = np.arange(1200) * 5e-5


def tasks() -> dict[str, Callable[[], object]]:
    """Return what is timed, by name; each returns a displacement or what it has instead."""
    from analysis.collision.effects import CATALOGUE
    from analysis.collision.parameters import PAPER
    from analysis.collision.solver import general
    from tests.analysis.inference.shown import model_of, shown

    out: dict[str, Callable[[], object]] = {
        "two bodies": lambda: general.solve(PAPER, (), TIME_S).displacement_m,
        "two bodies, 7 derivatives": lambda: general.solve(PAPER, (), TIME_S, directions=range(7)).displacement_m,
        "two bodies, 7 derivatives, means of 5": lambda: (
            general.solve(PAPER, [], TIME_S, directions=range(7), block=5).displacement_m
        ),
    }
    for name in ("coulomb_friction", "second_plate_mode", "adhesion", "cubic_stiffness", "contact_exponent"):
        row = CATALOGUE[name]
        active = [general.ActiveEffect(row, tuple(p.scale for p in row.parameters))]
        by = [0, 1, 2, 3, 4, *(general.direction(0, place) for place in range(len(row.parameters)))]

        def solve(active: object = active, by: object = (), block: int = 1) -> object:
            return general.solve(PAPER, active, TIME_S, directions=by, block=block).displacement_m  # type: ignore[arg-type]

        out[name] = solve
        out[f"{name}, {len(by)} derivatives"] = lambda s=solve, by=by: s(by=by)
        out[f"{name}, {len(by)} derivatives, means of 5"] = lambda s=solve, by=by: s(by=by, block=5)
    own = np.array([-0.27, 0.0101234, 3e-6])
    for name in ("cubic_stiffness", "contact_exponent"):
        values = {name: {p.name: p.scale for p in CATALOGUE[name].parameters}}
        out[f"a score by a trajectory: {name}"] = lambda v=values: (
            shown(SCREENED_S, PAPER.vector[:4], own, v).displacement_m
        )
    shot = model_of(SCREENED_S, PAPER.vector[:4], own, {})
    for steps in (1, 4):
        out[f"linear path, {steps} steps a sample"] = lambda s=steps: shot.path(s).length_s
    return out


def answer() -> None:
    """Answer the names that are read: processor time in s, then how many numbers and the numbers."""
    known = tasks()
    for line in sys.stdin:
        task = known[line.strip()]
        task()  # the other version has had the processor's caches
        began = time.process_time()
        for _ in range(AT_ONCE):
            task()
        spent = (time.process_time() - began) / AT_ONCE
        numbers = np.ascontiguousarray(task(), dtype=np.float64)
        sys.stdout.buffer.write(f"{spent!r} {numbers.size}\n".encode() + numbers.tobytes())
        sys.stdout.buffer.flush()


class Asked:
    """A version of the program in a process of its own."""

    def __init__(self, folder: Path) -> None:
        environment = dict(os.environ, PYTHONPATH=f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
        code = f"import runpy; runpy.run_path({str(Path(__file__).resolve())!r})['answer']()"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code], cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __call__(self, name: str) -> tuple[float, np.ndarray]:
        """Return (processor time in s, numbers) of a task."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(f"{name}\n".encode())
        self.process.stdin.flush()
        spent, size = self.process.stdout.readline().split()
        return float(spent), np.frombuffer(self.process.stdout.read(8 * int(size)))


def main() -> int:
    """Print the table."""
    here = Path(__file__).resolve().parents[2]
    versions = [Asked(here), *(Asked(Path(folder).resolve()) for folder in sys.argv[1:2])]
    print(f"{'way':<58} {'ms':>8} {'other/this':>11} {'differ by':>10}")
    for name in tasks():
        seconds, numbers = [[] for _ in versions], [np.empty(0) for _ in versions]
        for version in versions:
            version(name)
        for _ in range(ROUNDS):
            for k, version in enumerate(versions):
                spent, numbers[k] = version(name)
                seconds[k].append(spent)
        line = f"{name:<58} {min(seconds[0]) * 1e3:8.3f}"
        if len(versions) > 1:
            same = numbers[0].size == numbers[1].size
            apart = f"{np.abs(numbers[0] - numbers[1]).max():10.1e}" if same else "         -"
            line += f" {min(seconds[1]) / min(seconds[0]):11.2f} {apart}"
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
