"""``levimass --doctor --bundle FILE``: checks, versions, settings and log in one ZIP file for support."""

import getpass
import io
import json
import os
import re
import zipfile
from collections.abc import Sequence
from importlib.metadata import distributions
from pathlib import Path

from platformdirs import user_config_path, user_log_path

from app.command_line.machine import version_text
from app.session import NAME
from instrument.devices import Check
from instrument.files import RecordingError, open_regular, write_atomic

_MOST_OF_A_FILE = 4 << 20


def write_bundle(path: Path, checks: Sequence[Check]) -> None:
    """Write checks, versions, settings and log, without the user's name and home folder; no recording, no result.

    Raises RecordingError where the file cannot be written.
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
    """Return the end of a text file.  Raises RecordingError, also for a pipe, which could block without end."""
    with os.fdopen(open_regular(file), "rb") as opened:
        opened.seek(max(0, os.fstat(opened.fileno()).st_size - _MOST_OF_A_FILE))
        return opened.read(_MOST_OF_A_FILE).decode(errors="replace")


def _anonymous(text: str) -> str:
    """Return the text without home folder (also JSON-escaped, links followed) and without the user's name in paths."""
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
