"""Plots of a shot's raw channels in volts; decimation keeps the extremes at every zoom."""

from dataclasses import dataclass

import numpy as np
from PySide6.QtWidgets import QWidget

from analysis.shot import Recording, Role
from app.window.plots.curve import Pyramid
from app.window.plots.lines import MEASURED
from app.window.plots.plot_notes import NoteAxes
from app.window.plots.time_plot import TimeStack
from app.words import number
from instrument.live import CHANNEL_NAMES


@dataclass(frozen=True, slots=True, eq=False)
class RawCurves:
    """Each channel of a recording in volts, with its pyramid of extremes."""

    recording: Recording
    volts: dict[Role, Pyramid]


def curves_of(recording: Recording) -> RawCurves:
    """Return the curves of a recording; cost: two passes over its samples, 0.1 s for 5 M samples of three channels."""
    volts = {}
    for role in CHANNEL_NAMES:
        index = recording.column(role)
        if index is not None:
            channel = recording.channels[index]
            values = np.multiply(recording.counts[:, index], np.float32(channel.volts_per_count), dtype=np.float32)
            values += np.float32(channel.offset_v)
            volts[role] = Pyramid(values)
    return RawCurves(recording, volts)


def trigger_level_v(recording: Recording) -> float | None:
    """Return the light switch's voltage at the trigger, the mean of its sample and the one before; None if unknown."""
    at, column = recording.trigger_sample, recording.column(Role.SWITCH)
    if at is None or column is None or not 0 < at < recording.samples:
        return None
    channel = recording.channels[column]
    before, after = (float(count) for count in recording.counts[at - 1 : at + 1, column])
    return 0.5 * (before + after) * channel.volts_per_count + channel.offset_v


class RawView:
    """Three linked plots of the raw channels; missing channels are hidden."""

    def __init__(self, parent: QWidget) -> None:
        self.stack = TimeStack("Raw signals", parent)
        self._plots = {role: self.stack.add_plot(name, "V", 2) for role, name in CHANNEL_NAMES.items()}
        self._curves = {role: plot.add_curve("samples", MEASURED) for role, plot in self._plots.items()}
        self._recording: Recording | None = None
        self._zero = 0.0
        self._drawn = False
        self.has_samples = False

    def show_recording(self, recording: Recording | None, zero_s: float) -> None:
        """Set the recording; a job makes its curves once the view is shown (see ``wanted``)."""
        self._recording, self._zero = recording, zero_s
        if recording is not None:
            left = -1e3 * zero_s
            self.stack.whole = left, left + 1e3 * recording.samples / recording.sample_rate_hz
        self._drawn = False
        self.has_samples = recording is not None and recording.samples > 0
        for curve in self._curves.values():
            curve.clear_samples()

    @property
    def wanted(self) -> Recording | None:
        """Get the recording if its curves are still to be made, else None."""
        return self._recording if self.has_samples and not self._drawn else None

    def show_curves(self, curves: RawCurves) -> bool:
        """Show the curves if they belong to the set recording; return whether they do."""
        if curves.recording is not self._recording:
            return False
        self._drawn = True
        for role, curve in self._curves.items():
            pyramid = curves.volts.get(role)
            self._plots[role].setVisible(pyramid is not None)
            if pyramid is not None:
                self.stack.notes.describe(self._plots[role], NoteAxes(CHANNEL_NAMES[role], self._zero, 1e3))
                curve.show_samples(-1e3 * self._zero, 1e3 / curves.recording.sample_rate_hz, pyramid)
        level = trigger_level_v(curves.recording)
        self._plots[Role.SWITCH].show_levels({} if level is None else {f"trigger, {number(level, 3)} V": level})
        self.stack.reset()
        return True
