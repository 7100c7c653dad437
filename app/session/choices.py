"""The settings in use, saved at each change; read by the rig's threads, changed by the window."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from analysis.shot import AIR, AnalysisSettings
from app.session import settings_file
from app.session.settings import MOST_ADDRESSES, WrongSettings
from instrument.capture import CaptureOptions
from instrument.devices import Digitizer, source_of
from levimass import Value

MOST_RECENT = 12
RIG = (  # settings that are corrected together
    ("moving_mass_kg", "moving_mass_u_kg"),
    ("wavelength_vacuum_m", "wavelength_air_m", *AIR),
    ("rest_frequency_hz",),
)


class Choices:
    """Holds the settings in use, an immutable Settings that is replaced at each change."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.settings, self.warnings = settings_file.load(path)
        self._changed: set[str] = set()  # names of settings changed since the start

    def change(self, values: dict[str, Value]) -> str | None:
        """Change and save settings; return why that failed, or None."""
        before = self.settings.values()
        try:
            self.settings = self.settings.with_values(values)
        except WrongSettings as error:
            return str(error)
        self._changed |= {name for name, value in values.items() if value != before[name]}
        return settings_file.save(self._path, self.settings)

    def remember_source(self, source: str) -> None:
        """Open this source at the next start too, unless it is a replay."""
        if source_of(source).remembered:
            self.change({"source": source})

    def remember_network(self, source: str) -> None:
        """Offer this oscilloscope in the network from now on."""
        known = (source, *(other for other in self.settings.network_sources if other != source))
        self.change({"network": " ".join(known[:MOST_ADDRESSES])})

    @property
    def recent(self) -> list[Path]:
        """Get the recently opened files, newest first."""
        return [Path(line) for line in self.settings.recent.splitlines() if line]

    @property
    def sessions(self) -> list[Path]:
        """Get the known session files: those without a name, and recently opened ones."""
        without_name = sorted(self._path.parent.glob("session*.json"))
        return [*without_name, *(path for path in self.recent if path.suffix == ".json")]

    def remember_recent(self, paths: Sequence[Path]) -> None:
        """Add these to the recently opened files."""
        newest = [str(path.absolute()) for path in paths[:MOST_RECENT]]
        older = [str(path) for path in self.recent if str(path) not in newest]
        kept = [line for line in (*newest, *older) if "\n" not in line]
        self.change({"recent": "\n".join(kept[:MOST_RECENT])})

    @property
    def start_folder(self) -> Path:
        """Get the folder that file dialogs show first: that of the shots, where it exists."""
        folder = self.settings.data_folder
        return folder if folder.is_dir() else Path.home()

    def analysis(self) -> AnalysisSettings:
        """Return the settings of the analysis."""
        return self.settings.analysis

    def analysis_again(self) -> AnalysisSettings:
        """Return the settings for repeating an analysis: with the rig's values that were changed since the start.

        Other values are left to the recording, which may be of another rig.
        """
        values = self.settings.values()
        names = [name for group in RIG for name in group if self._changed.intersection(group)]
        corrections = tuple((name, cast(float | None, values[name])) for name in names)  # all are numbers
        return replace(self.settings.analysis, corrections=corrections)

    def options(self, source: str, digitizer: Digitizer) -> CaptureOptions:
        """Return how shots are taken with a source.  Raises OSError where the folder cannot be made."""
        return self.settings.options(source, digitizer)
