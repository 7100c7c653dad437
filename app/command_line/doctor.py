"""``levimass doctor``: check this machine, write a ZIP file for support; ``levimass prepare``: compile all kernels."""

import getpass
import io
import json
import os
import re
import sys
import time
import zipfile
from collections.abc import Sequence
from importlib.metadata import distributions
from pathlib import Path

from platformdirs import user_config_path, user_log_path

from analysis.compiled import cache_folder
from analysis.shot import Progress
from app.command_line.machine import installed, version_text, why_no_window
from app.command_line.outputs import say
from app.session import NAME, complete
from app.session import prepare as compile_all
from instrument.devices import Check, DigitizerError, Grade, check_computer
from instrument.files import RecordingError, open_regular, write_atomic
from instrument.live import try_signals
from instrument.process import open_in_subprocess


def doctor(folder: Path | None = None, source: str | None = None, bundle: Path | None = None) -> int:
    """Print the checks of this machine and of the signals of a ``source``; return 1 if a check failed, else 0.

    ``bundle`` is the path of the ZIP file for support.
    """
    where = Path(__file__).resolve().parents[2]
    checks = [
        Check("levimass", Grade.OK, f"{installed('levimass')}, in {where}"),
        *check_computer(folder or Path.cwd()),
        _qt(),
        _kernels(),
        Check("log", Grade.OK, str(user_log_path("levimass") / NAME)),
    ]
    if source is not None:
        checks += _signals(source)
    for check in checks:
        print(f"{check.grade.value:<5} {check.name}: {check.line}")
    sys.stdout.flush()
    if bundle is not None:
        try:
            write_bundle(bundle, checks)
        except RecordingError as error:
            say(error)
            return 1
        print(f"levimass: written to {bundle}: these checks, versions, settings and log; no recordings")
    return 1 if any(check.grade is Grade.FAIL for check in checks) else 0


def _signals(source: str) -> list[Check]:
    try:
        digitizer = open_in_subprocess(source)
        try:
            return [Check(f"signal, {check.name}", check.grade, check.line) for check in try_signals(digitizer)]
        finally:
            digitizer.close()
    except DigitizerError as error:
        return [Check("source", Grade.FAIL, str(error))]


def _kernels() -> Check:
    folder = cache_folder()
    size = sum(file.stat().st_size for file in folder.rglob("*.nb*")) / 1e6
    if complete():
        return Check("compiled code", Grade.OK, f"complete, {size:.0f} MB in {folder}")
    return Check("compiled code", Grade.OK, f"not complete, {size:.0f} MB in {folder}; levimass prepare completes it")


def _qt() -> Check:
    problem = why_no_window()
    if problem is None:
        return Check("window", Grade.OK, "Qt starts")
    return Check("window", Grade.WARN, f"{problem}; every mode of the command line works all the same")


def prepare(jobs: int | None = None) -> int:
    """Compile all missing kernels in ``jobs`` processes and print progress; return the exit status."""
    if complete():
        print(f"levimass: everything is compiled already, in {cache_folder()}")
        return 0
    began = time.monotonic()
    if not compile_all(progress_lines(), lambda: False, at_once=jobs):
        say("not all kernels could be compiled; the others are compiled on first use")
        return 1
    print(f"levimass: compiled in {time.monotonic() - began:.0f} s, cached in {cache_folder()}")
    return 0


def progress_lines() -> Progress:
    """Return a progress function that prints one line per step on standard error."""
    last = ""

    def report(words: str, share: float) -> None:
        nonlocal last
        line = f"{100 * share:3.0f} %  {words}"
        if line != last:
            print(line, file=sys.stderr)
        last = line

    return report


_MOST_OF_A_FILE = 4 << 20


def write_bundle(path: Path, checks: Sequence[Check]) -> None:
    """Write a ZIP file with checks, versions, settings and log, without the user's name and home folder.

    It contains no recordings and no results.  Raises RecordingError if the file cannot be written.
    """
    packages = sorted({f"{each.name} {each.version}" for each in distributions()})
    texts = {
        "doctor.txt": "".join(f"{check.grade.value:<5} {check.name}: {check.line}\n" for check in checks),
        "versions.txt": "\n".join([version_text(), *packages]) + "\n",
    }
    log, settings = user_log_path("levimass"), user_config_path("levimass") / "settings.json"
    for file in (settings, *sorted(log.glob(f"{NAME}*"))):
        try:
            texts[file.name] = _end_of(file)
        except RecordingError as error:
            texts[f"{file.name}.missing"] = f"{error}\n"
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, text in texts.items():
            bundle.writestr(name, _anonymous(text))
    write_atomic(path, [whole.getvalue()], sync=True)


def _end_of(file: Path) -> str:
    """Return the last 4 MiB of a text file.  Raises RecordingError, also for pipes, which could block for ever."""
    with os.fdopen(open_regular(file), "rb") as opened:
        opened.seek(max(0, os.fstat(opened.fileno()).st_size - _MOST_OF_A_FILE))
        return opened.read(_MOST_OF_A_FILE).decode(errors="replace")


def _anonymous(text: str) -> str:
    """Replace the home folder (also JSON-escaped, also with links resolved) and the user's name in paths by "~"."""
    homes = {str(Path.home()), os.path.realpath(Path.home())}
    for home in sorted(homes, key=len, reverse=True):
        escaped = json.dumps(home)[1:-1]
        for written in (escaped, home, home.replace(os.sep, "/"), home.replace("\\", "\\\\")):
            text = text.replace(written, "~") if len(written) > 1 else text
    for name in {Path.home().name, _user()} - {"", "root"}:
        for written in {name, json.dumps(name)[1:-1]}:
            text = re.sub(rf"(?<=[/\\]){re.escape(written)}(?=[/\\\"\s:,;]|$)", "~", text, flags=re.MULTILINE)
    return text


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
