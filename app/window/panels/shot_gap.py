"""Gap between block and plate over time (the paper's Fig. 7), the contact force below it."""

import numpy as np
from PySide6.QtWidgets import QWidget

from analysis.shot import Shot
from app.report import contact_span_ms, time_zero
from app.window.pens import thin, under
from app.window.plots.plot_notes import NoteAxes
from app.window.plots.time_stack import TimeStack
from app.window.theme import Colours


class GapView:
    """The gap in the fitted model, as the plate is not measured, and the force."""

    def __init__(self, colours: Colours, parent: QWidget) -> None:
        self.stack = TimeStack("Gap between block and plate", colours, parent)
        self._gap_plot = self.stack.add_plot("gap", "µm", 3)
        self._force_plot = self.stack.add_plot("force", "N", 2)
        self._gap = self._gap_plot.add_curve("simulated", under(colours.simulated))
        self._simulated = self._force_plot.add_curve("simulated", under(colours.simulated))
        self._measured = self._force_plot.add_curve("measured", thin(colours.measured))
        self._gap_plot.mark_level(0.0, "below: overlap")
        self._span = (-1.0, 8.0)

    def dress(self, colours: Colours) -> None:
        self.stack.dress(colours)
        self._gap.setPen(under(colours.simulated))
        self._measured.setPen(thin(colours.measured))
        self._simulated.setPen(under(colours.simulated))

    def show_shot(self, shot: Shot) -> None:
        """Show an analysed shot."""
        assert shot.motion is not None
        zero, _ = time_zero(shot)
        start, step = 1e3 * (float(shot.motion.time_s[0]) - zero), 1e3 / shot.motion.sample_rate_hz
        self.stack.notes.describe(self._gap_plot, NoteAxes("gap", zero, 1e3, 1e6))
        self.stack.notes.describe(self._force_plot, NoteAxes("force", zero, 1e3))
        self._measured.show_samples(start, step, shot.motion.force_n)
        fit = shot.fit
        if fit is None or not fit.shots:
            self._gap.clear_samples()
            self._simulated.clear_samples()
        else:
            overlay = fit.shots[0].overlay
            self._gap.show_samples(start, step, 1e6 * np.asarray(overlay.gap_m))
            self._simulated.show_samples(start, step, overlay.force_n)
        self._span = contact_span_ms(shot)

    def reset(self) -> None:
        """Show the bounces."""
        self.stack.zoom(*self._span)
