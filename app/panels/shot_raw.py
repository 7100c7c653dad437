"""The raw channels of a shot in volts, every sample kept at every zoom."""

import numpy as np
from PySide6.QtWidgets import QWidget

from analysis.recording import Recording, Role
from app.plots.pyramid import Pyramid
from app.plots.time_stack import TimeStack
from app.theme import Colours, thin

NAMES = {Role.REFERENCE: "PD0", Role.MEASUREMENT: "PD1", Role.SWITCH: "light switch"}


class RawView:
    """Three linked plots; a channel that the recording lacks is hidden."""

    def __init__(self, colours: Colours, parent: QWidget) -> None:
        self.stack = TimeStack("Raw signals", colours, parent)
        self._plots = {role: self.stack.add_plot(name, "V", 2) for role, name in NAMES.items()}
        self._curves = {role: plot.add_curve("samples", thin(colours.measured)) for role, plot in self._plots.items()}
        self._recording: Recording | None = None
        self._zero = 0.0
        self._built = False
        self.has_samples = False

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.stack.dress(colours)
        for curve in self._curves.values():
            curve.setPen(thin(colours.measured))

    def show_recording(self, recording: Recording | None, zero_s: float) -> None:
        """Take a recording; its pyramids are built when the view is first asked for."""
        self._recording, self._zero = recording, zero_s
        self._built = False
        self.has_samples = recording is not None and recording.samples > 0
        for curve in self._curves.values():
            curve.clear_samples()

    def reset(self) -> None:
        """Show the whole record."""
        recording = self._recording
        if recording is None or recording.samples == 0:
            return
        if not self._built:
            self._build(recording)
        left = -1e3 * self._zero
        self.stack.zoom(left, left + 1e3 * recording.samples / recording.sample_rate_hz)

    def _build(self, recording: Recording) -> None:
        self._built = True
        step = 1e3 / recording.sample_rate_hz
        for role, curve in self._curves.items():
            index = recording.column(role)
            self._plots[role].setVisible(index is not None)
            if index is None:
                continue
            channel = recording.channels[index]
            volts = np.multiply(recording.counts[:, index], np.float32(channel.volts_per_count), dtype=np.float32)
            volts += np.float32(channel.offset_v)
            curve.show_samples(-1e3 * self._zero, step, Pyramid(volts))
