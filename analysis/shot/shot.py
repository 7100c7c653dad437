"""An analysed shot with its motion, impact and fit, and the operator's notes on its plots."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.recording import Setup
from levimass import AnalysisSettings as AnalysisSettings

Progress = Callable[[str, float], None]  # (current step, fraction of the analysis done)
Stop = Callable[[], bool]  # whether the caller has cancelled


MAX_NOTE_LENGTH = 200  # characters
SECOND = "s"
PLOT_UNITS: Mapping[str, tuple[str, str]] = {  # plot name -> units of x and y
    "velocity": (SECOND, "m/s"),
    "force": (SECOND, "N"),
    "residual of displacement": (SECOND, "m"),
    "residual of velocity": (SECOND, "m/s"),
    "residual of force": (SECOND, "N"),
    "gap": (SECOND, "m"),
    "PD0": (SECOND, "V"),
    "PD1": (SECOND, "V"),
    "light switch": (SECOND, "V"),
    "force vs deflection": ("m", "N"),
    "force vs speed": ("m/s", "N"),
    "residual of force vs speed": ("m/s", "N"),
    "force vs position": ("m", "N"),
    "residual of force vs position": ("m", "N"),
    "spectrum": ("Hz", "dB above 1 V²/Hz"),
    "spectrogram": (SECOND, "Hz"),
}


class AnalysisError(Exception):
    """The shot could not be analysed; the message gives the reason in one line."""


class ChannelsSwapped(AnalysisError):
    """The cables of PD0 and PD1, or the roles of their channels, are swapped."""


class Cancelled(Exception):
    """The caller asked the analysis to stop."""


@dataclass(frozen=True, slots=True)
class PlotNote:
    """A short text that the operator placed at a point of one of a shot's plots.

    ``plot`` is a key of ``PLOT_UNITS``; ``x`` and ``y`` are in the units listed there, whatever units the axes show.
    Time counts from the recording's first sample, as a new analysis shifts first touch, the zero of the plots' time.
    """

    plot: str
    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True)
class Shot:
    """One analysed shot; a part is None if its step or an earlier step failed, with the reason in ``problem``."""

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
    readings_fit: Fit | None = None  # a diagnosis's fit, used for readings that need a model; None: use ``fit``
    flags: tuple[str, ...] = ()
    problem: str | None = None
    channels_swapped: bool = False  # True: this is the problem
    fit_problem: str | None = None  # why the fit failed although the impact was read
    fit_stopped: bool = False  # True: the fit was stopped before its end and may be repeated
    started_at: str | None = None
    note: str = ""
    plot_notes: tuple[PlotNote, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)  # "load", "demodulate", "impact", "fit"


def fitted_shots(shots: Iterable[Shot]) -> list[Shot]:
    """Return the shots that have a motion and a fit."""
    return [shot for shot in shots if shot.motion is not None and shot.fit is not None]


def motions_of(shots: Iterable[Shot]) -> list[Motion]:
    """Return the motions of the shots that have one."""
    return [shot.motion for shot in shots if shot.motion is not None]
