"""``levimass --doctor --bundle FILE``: what who helps wants to see, in one ZIP file; no recording and no result."""

import io
import os
import zipfile
from collections.abc import Sequence
from importlib.metadata import distributions
from pathlib import Path

from platformdirs import user_config_path, user_log_path

from app.command_line.version import version_text
from app.session.log import NAME
from instrument.doctor import Check
from instrument.recording_writer import write_beside

_MOST_OF_A_FILE = 4 << 20


def write_bundle(path: Path, checks: Sequence[Check]) -> None:
    """Write checks, versions, settings and log.  Raises RecordingError where the file cannot be written.

    The user's name and home folder are taken out of the texts.
    """
    packages = sorted({f"{each.name} {each.version}" for each in distributions()})
    texts = {
        "doctor.txt": "".join(f"{check.grade.value:<5} {check.name}: {check.line}\n" for check in checks),
        "versions.txt": "\n".join([version_text(), *packages]) + "\n",
    }
    log, settings = user_log_path("levimass"), user_config_path("levimass") / "settings.json"
    for file in (settings, *sorted(log.glob(f"{NAME}*"))):
        try:
            texts[file.name] = file.read_bytes()[-_MOST_OF_A_FILE:].decode(errors="replace")
        except OSError as error:
            texts[f"{file.name}.missing"] = f"{error.strerror or error}\n"
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, text in texts.items():
            bundle.writestr(name, _anonymous(text))
    write_beside(path, [whole.getvalue()], sync=False)


def _anonymous(text: str) -> str:
    home = str(Path.home())
    for written in {home, home.replace(os.sep, "/"), home.replace("\\", "\\\\")}:
        text = text.replace(written, "~") if len(written) > 1 else text
    return text
