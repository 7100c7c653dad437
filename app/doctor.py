"""``levimass --doctor``: what this machine has and lacks, one line each."""

import sys
from pathlib import Path

from app.start import why_no_window
from instrument.doctor import Check, Grade, examine


def doctor(folder: Path | None = None) -> int:
    """Print the checks; return 1 when one of them failed outright."""
    checks = [*examine(folder or Path.cwd()), _qt()]
    for check in checks:
        print(f"{check.grade.value:<5} {check.name}: {check.line}")
    sys.stdout.flush()
    return 1 if any(check.grade is Grade.FAIL for check in checks) else 0


def _qt() -> Check:
    problem = why_no_window()
    if problem is None:
        return Check("window", Grade.OK, "Qt starts")
    return Check("window", Grade.WARN, f"{problem}; every mode of the command line works all the same")
