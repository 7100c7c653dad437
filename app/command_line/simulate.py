"""``levimass --simulate``: recordings from the simulated bench."""

import sys
from pathlib import Path

from instrument.bench.effects import parse
from instrument.bench.simulate import simulate as write_simulated
from instrument.bench.site import QUIET, site_named
from instrument.files.recording_error import RecordingError


def simulate(
    folder: Path, *, shots: int, seed: int, effect: str | None, undeclared: bool, site: str | None = None
) -> int:
    """Write the recordings, of a quiet bench where no ``site`` is named, and print their paths; return the status."""
    try:
        effects = parse(effect) if effect else None
    except ValueError as error:
        print(f"levimass: --effect: {error}", file=sys.stderr)
        return 2
    try:
        place = site_named(site) if site is not None else QUIET
    except ValueError as error:
        print(f"levimass: --site: {error}", file=sys.stderr)
        return 2
    try:
        paths = write_simulated(folder, shots, seed, effects, undeclared, site=place)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"levimass: {error.filename or folder}: {error.strerror or error}", file=sys.stderr)
        return 1
    for path in paths:
        print(path)
    return 0
