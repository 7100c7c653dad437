"""Whether a worker can do a campaign's work where it stands."""

import os
import uuid
from collections.abc import Iterable
from pathlib import Path

from analysis.shot.version import program


def unfit(wanted_program: str, reads: Iterable[str], writes: str | None) -> str | None:
    """Return why work that reads from and writes to these folders cannot be done here, or None."""
    if (own := program()) != wanted_program:
        return f"has levimass {own}, not {wanted_program}"
    for folder in reads:
        if not os.path.isdir(folder):
            return f"does not see the folder {folder}"
        if not os.access(folder, os.R_OK | os.X_OK):
            return f"may not read the folder {folder}"
    if writes is not None:
        trial = Path(writes) / f".levimass-{uuid.uuid4().hex}"
        try:
            trial.write_bytes(b"levimass")
            trial.unlink()
        except OSError as error:
            return f"cannot write to {writes} ({error.strerror or error})"
    return None
