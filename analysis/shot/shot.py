"""One analysed shot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.plot_note import PlotNote
from analysis.shot.recording import Setup
from levimass import AnalysisSettings as AnalysisSettings

Progress = Callable[[str, float], None]  # (what is being done, fraction of the whole)
Stop = Callable[[], bool]  # whether the caller has cancelled


class AnalysisError(Exception):
    """Why a shot could not be analysed, in one line."""


class Cancelled(Exception):
    """The caller asked the analysis to stop."""


@dataclass(frozen=True, slots=True)
class Shot:
    """One analysed shot; a part is None where it or one before it failed, for the reason ``problem``."""

    name: str
    path: str | None
    settings: AnalysisSettings
    setup: Setup | None
    sample_rate_hz: float | None
    samples: int | None
    trigger_time_s: float | None
    motion: Motion | None
    impact: Impact | None
    fit: Fit | None
    readings_fit: Fit | None = None  # of a diagnosis, for the readings that come from a model; None: ``fit``
    flags: tuple[str, ...] = ()
    problem: str | None = None
    fit_problem: str | None = None  # why the model could not be fitted to a shot that was read
    started_at: str | None = None
    note: str = ""
    plot_notes: tuple[PlotNote, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)  # "load", "demodulate", "impact", "fit"
