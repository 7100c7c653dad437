"""One analysed shot, and the operator's notes on its plots."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.recording import Setup
from levimass import AnalysisSettings as AnalysisSettings

Progress = Callable[[str, float], None]  # (what is being done, fraction of the whole)
Stop = Callable[[], bool]  # whether the caller has cancelled


LONGEST = 200  # characters of a note
TIME = "s"
UNITS: Mapping[str, tuple[str, str]] = {  # of x and y, by the plot's name
    "velocity": (TIME, "m/s"),
    "force": (TIME, "N"),
    "residual of displacement": (TIME, "m"),
    "residual of velocity": (TIME, "m/s"),
    "residual of force": (TIME, "N"),
    "gap": (TIME, "m"),
    "PD0": (TIME, "V"),
    "PD1": (TIME, "V"),
    "light switch": (TIME, "V"),
    "force vs deflection": ("m", "N"),
    "force vs speed": ("m/s", "N"),
    "residual of force vs speed": ("m/s", "N"),
    "force vs position": ("m", "N"),
    "residual of force vs position": ("m", "N"),
    "spectrum": ("Hz", "dB above 1 V²/Hz"),
    "spectrogram": (TIME, "Hz"),
}


class AnalysisError(Exception):
    """Why a shot could not be analysed, in one line."""


class Cancelled(Exception):
    """The caller asked the analysis to stop."""


@dataclass(frozen=True, slots=True)
class PlotNote:
    """A short text that the operator put at a place of one of a shot's plots.

    It is kept in the units of ``UNITS``, so that it stays in its place whatever the plot's axes count in.
    ``plot`` is a name of ``UNITS``.  Time counts from the recording's first sample: first touch, from which the plots
    count, moves with every new analysis.
    """

    plot: str
    x: float
    y: float
    text: str


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
