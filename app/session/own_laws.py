"""The folder of a person's own laws: what the next diagnoses ask beside the catalogue."""

from pathlib import Path
from typing import Any

from analysis.collision.laws.own import LawError, OwnLaw, from_mapping
from instrument.files.law_file import read_laws, write_law


class OwnLaws:
    """Reads the folder anew each time: a file may come and go while the window is open."""

    def __init__(self, folder: Path | None) -> None:
        """``folder`` None: there are no laws, and none can be kept."""
        self.folder = folder

    def keys(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the keys of the laws there are, and one line for each file that holds none."""
        laws, problems = read_laws(self.folder) if self.folder is not None else ([], [])
        return tuple(law.key for law in laws), tuple(problems)

    def keep(self, table: dict[str, Any]) -> OwnLaw:
        """Keep the law that a table describes; RecordingError or LawError, one line, says why that cannot be."""
        law = from_mapping(table)
        if self.folder is None:
            raise LawError("there is no folder for laws here")
        write_law(law, self.folder)
        return law
