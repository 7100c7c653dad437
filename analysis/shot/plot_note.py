"""A short text that the operator put at a place of one of a shot's plots."""

from collections.abc import Mapping
from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class PlotNote:
    """One note, kept in the units of ``UNITS``, so that it stays in its place whatever the plot's axes count in.

    ``plot`` is a name of ``UNITS``.  Time counts from the recording's first sample: first touch, from which the plots
    count, moves with every new analysis.
    """

    plot: str
    x: float
    y: float
    text: str
