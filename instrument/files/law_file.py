"""Read and write the user's own laws, one TOML file per law in one folder (docs/own-laws.md)."""

from pathlib import Path

from analysis.collision import LawError, UserLaw, law_from_table
from instrument.files.atomic_file import write_toml_atomic
from instrument.files.recording_error import RecordingError, system_message
from instrument.files.text_file import read_toml


def read_law(path: Path) -> UserLaw:
    """Read a law.  Raises RecordingError."""
    try:
        return law_from_table(read_toml(path))
    except LawError as error:
        raise RecordingError(path, str(error)) from None


def read_laws(folder: Path) -> tuple[list[UserLaw], list[str]]:
    """Return the laws in ``folder`` in file order, and one line of text for each file that cannot be read."""
    laws: dict[str, UserLaw] = {}
    problems: list[str] = []
    for path in sorted(folder.glob("*.toml")):
        try:
            law = read_law(path)
            if law.name in laws:
                raise RecordingError(path, f"another file of this folder has a law called {law.name!r}")
            laws[law.name] = law
        except RecordingError as error:
            problems.append(str(error))
    return list(laws.values()), problems


def write_law(law: UserLaw, folder: Path) -> Path:
    """Write a law as ``NAME.toml`` into ``folder``, never over another; return its path.  Raises RecordingError."""
    path = folder / f"{law.name}.toml"
    if path.exists():
        raise RecordingError(path, "there is a law of this name already; choose another")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(folder, system_message(error)) from None
    write_toml_atomic(path, law.written())
    return path
