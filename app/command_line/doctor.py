"""``levimass --doctor``: what this machine has and lacks, one line each."""

import sys
from pathlib import Path

from app.command_line.display import why_no_window
from instrument.apart.digitizer import open_apart
from instrument.digitizer import DigitizerError
from instrument.doctor import Check, Grade, examine
from instrument.signal_trial import try_signals


def doctor(folder: Path | None = None, source: str | None = None) -> int:
    """Print the checks, with a ``source`` those of its signals too; return 1 when one of them failed outright."""
    checks = [*examine(folder or Path.cwd()), _qt()]
    if source is not None:
        checks += _signals(source)
    for check in checks:
        print(f"{check.grade.value:<5} {check.name}: {check.line}")
    sys.stdout.flush()
    return 1 if any(check.grade is Grade.FAIL for check in checks) else 0


def _signals(source: str) -> list[Check]:
    try:
        digitizer = open_apart(source)
        try:
            return [Check(f"signal, {check.name}", check.grade, check.line) for check in try_signals(digitizer)]
        finally:
            digitizer.close()
    except DigitizerError as error:
        return [Check("source", Grade.FAIL, str(error))]


def _qt() -> Check:
    problem = why_no_window()
    if problem is None:
        return Check("window", Grade.OK, "Qt starts")
    return Check("window", Grade.WARN, f"{problem}; every mode of the command line works all the same")
