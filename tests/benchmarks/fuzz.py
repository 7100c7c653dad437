"""Spoilt recordings, motion records and settings: ``python -m tests.benchmarks.fuzz [--times 12000] [--seed 1]``."""

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from analysis.shot.recording import Channel, Gap, Recording, Role, Setup
from tests.instrument.fuzzing import fuzz


def main() -> None:
    """Spoil, read, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=12_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    shot = Recording(
        "s", rng.integers(-2000, 2000, (2_000, 3)).astype(np.int16), 30e6,
        (Channel(Role.REFERENCE, 5e-4), Channel(Role.MEASUREMENT, 4e-4), Channel(Role.SWITCH, 1e-3)),
        Setup(0.01785, wavelength_air_m=632.8e-9, digitizer_bits=12, extra={"rig": "north"}),
        trigger_sample=500, gaps=(Gap(700, 3),), note="a note", started_at="2026-01-01T00:00:00Z",
    )  # fmt: skip
    begun = time.perf_counter()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryDirectory() as folder:
        happened = fuzz(Path(folder), shot, options.times, options.seed)
    for words, number in sorted(happened.items()):
        print(f"{number:7d}  {words}")
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(f"{sum(happened.values())} files in {time.perf_counter() - begun:.0f} s, no traceback, {grown:.0f} MB more")


if __name__ == "__main__":
    main()
