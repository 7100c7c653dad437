"""From a recording to everything one shot can tell: the one road that screen, replay and export all take."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.recording import Setup

Progress = Callable[[str, float], None]  # (what is being done, fraction of the whole)
Stop = Callable[[], bool]  # whether whoever asked no longer wants it


class AnalysisError(Exception):
    """Why a shot could not be analysed, in one line for a person."""


class Cancelled(Exception):
    """The caller asked the analysis to stop."""


@dataclass(frozen=True, slots=True)
class AnalysisSettings:
    """What a person may choose about an analysis; kept with the shot it was used for."""

    bandwidth_hz: float = 10e3  # of velocity and force
    motion_rate_hz: float = 100e3
    model: str = "paper"  # "paper" | "clamped" | "no_tension" | "contact" | "driven"
    rest: str = "smoothed"  # "smoothed" | "instantaneous": how PD0 is taken off
    fit: bool = True
    fit_seconds: float = 20.0  # the longest that the fit of one shot may take
    effects: tuple[str, ...] = ()  # of the catalogue, accepted into the model
    corrections: tuple[tuple[str, float | None], ...] = ()  # values of the rig put right afterwards: ``corrected``


@dataclass(frozen=True, slots=True)
class Shot:
    """One analysed shot; a part is None when the one before it failed, and ``problem`` says why."""

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
    readings_fit: Fit | None = None  # a diagnosis's, that readings which rest on a model were made again with
    flags: tuple[str, ...] = ()
    problem: str | None = None
    fit_problem: str | None = None  # why the model could not be fitted to a shot whose readings stand
    started_at: str | None = None
    note: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)  # "load", "demodulate", "impact", "fit"
