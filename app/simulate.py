"""``levimass --simulate``: recordings from the simulated bench."""

import sys
from pathlib import Path

from instrument.bench.effects import parse
from instrument.bench.simulate import simulate as write_simulated
from instrument.recording_error import RecordingError


def simulate(folder: Path, *, shots: int, seed: int, effect: str | None, undeclared: bool) -> int:
    """Write the recordings and print their paths; return the exit status."""
    try:
        effects = parse(effect) if effect else None
    except ValueError as error:
        print(f"levimass: --effect: {error}", file=sys.stderr)
        return 2
    try:
        for path in write_simulated(folder, shots, seed, effects, undeclared):
            print(path)
    except (RecordingError, OSError) as error:
        print(f"levimass: {folder}: {error}", file=sys.stderr)
        return 1
    return 0
