"""Plot of a learned law: its free curve with the 2 sigma band, its closed forms, and buttons to compare and save."""

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QWidget

from analysis.diagnosis import LearnedLaw
from analysis.shot import Shot
from app.report import law_columns
from app.window.plots.cursors import CursorAxis, CursorReadout
from app.window.plots.legend import Legend
from app.window.plots.lines import SIMULATED, LineStyle, series
from app.window.plots.plain_plot import PlainPlot
from app.window.widgets import add_row, added, push_button, text_label, vertical
from app.words import localised_text, prefix_for, short_name

MOST_FORMS = 4
ALONG = CursorAxis("mm", "mm")
EDGES, SHOWN = LineStyle("band_edge", width=1), LineStyle("measured", width=1)
OTHERS = [series(index + 2) for index in range(MOST_FORMS)]


class LawCurve(QWidget):
    """Shows one learned law; if there are two, a button shows the other."""

    keep_wanted = Signal(object)  # the OwnLaw to save

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._laws: tuple[LearnedLaw, ...] = ()
        self._which = 0
        column = vertical(self)
        self._heading = text_label("", self, heading=True, wrap=True)
        self.other = push_button("The other law", "Two laws were learned; show the other", self, self._turn)
        hover = "Overlay the other closed forms that fit"
        self.compare = push_button("Compare forms", hover, self, self._draw, checkable=True)
        self.keep = push_button("Save law as …", "Save it under a name; later diagnoses include it", self, self._keep)
        add_row(column, self._heading, self.other, self.compare, self.keep)
        self._legend = added(column, Legend(self))
        self.plot = PlainPlot("Learned law", ("force", "mN"), "", ALONG, self)
        self._band = [self.plot.add_curve(f"{sign} 2 σ", EDGES) for sign in ("-", "+")]
        self._curve = self.plot.add_curve("free curve", SHOWN)
        self._form = self.plot.add_curve("closed form", SIMULATED)
        self._form.setZValue(-1)
        self._others = [self.plot.add_curve(f"form {number}", look) for number, look in enumerate(OTHERS, 2)]
        self.plot.setMinimumHeight(9 * self.fontMetrics().lineSpacing())
        column.addWidget(self.plot, 1)
        column.addWidget(CursorReadout(self.plot, self))
        self._words = added(column, text_label("", self, faint=True, wrap=True))
        self.show_laws(())

    def show_laws(self, laws: Sequence[LearnedLaw], shots: Sequence[Shot] = ()) -> None:
        """Show the first of these laws, learned from ``shots``; hide the widget if there are none."""
        self.plot.set_shots(shots if laws else (), ", ".join(short_name(shot.name) for shot in shots) if laws else "")
        self._laws, self._which = tuple(laws), 0
        self.setVisible(bool(laws))
        self.other.setVisible(len(laws) > 1)
        self._draw()

    @property
    def law(self) -> LearnedLaw | None:
        return self._laws[self._which] if self._laws else None

    @Slot()
    def _turn(self) -> None:
        self._which = (self._which + 1) % max(1, len(self._laws))
        self._draw()

    @Slot()
    def _keep(self) -> None:
        if self.law is not None:
            self.keep_wanted.emit(self.law.effect)

    @Slot()
    def _draw(self) -> None:
        law = self.law
        for curve in (*self._band, self._curve, self._form, *self._others):
            curve.clear_samples()
        self.plot.columns = {}
        if law is None:
            return
        scale, unit = prefix_for(float(np.max(np.abs(law.curve_argument))), law.curve_unit)
        force_scale, force_unit = prefix_for(float(np.max(np.abs(law.curve_force_n))), "N")
        x = scale * law.curve_argument
        for sign, curve in zip((-1, 1), self._band, strict=True):
            curve.show_points(x, force_scale * (law.curve_force_n + sign * 2 * law.curve_std_n))
        self._curve.show_points(x, force_scale * law.curve_force_n)
        self._form.show_points(x, force_scale * law.form_force_n)
        self._form.label = law.nearest_form
        others = [other for other in law.other_forms if other.curve_force_n is not None][:MOST_FORMS]
        self.compare.setEnabled(bool(others))
        for curve, other in zip(self._others, others, strict=False):
            if self.compare.isChecked():
                assert other.curve_force_n is not None
                curve.label = other.form
                curve.show_points(x, force_scale * other.curve_force_n)
        legend = [("free curve", SHOWN), ("± 2 σ", EDGES)]
        legend.append((f"{'closed form' if law.form else 'nearest form'}: {law.nearest_form}", SIMULATED))
        if self.compare.isChecked():
            legend += [(other.form, look) for other, look in zip(others, OTHERS, strict=False)]
        self._legend.show_entries(legend)
        self.plot.legend = legend
        self.plot.plot.name_value("force", force_unit)
        self.plot.plot.getAxis("bottom").setLabel(f"{law.argument} ({unit})")
        self.plot.columns = {name: np.array(values) for name, values in law_columns(law).items()}
        force = force_scale * law.curve_force_n
        reach = 0.1 * max(float(np.ptp(force)), 1e-9)
        self.plot.show_range((float(x[0]), float(x[-1])), (float(force.min()) - reach, float(force.max()) + reach))
        place = {"block": "on the block", "plate": "on the plate"}.get(law.where, "between block and plate")
        count = f" {self._which + 1} OF {len(self._laws)}" if len(self._laws) > 1 else ""
        self._heading.setText(f"LEARNED LAW{count}: a force {place} as a function of {law.argument}")
        form = f"closed form: {law.form}" if law.form else f"no closed form fits; nearest: {law.nearest_form}"
        listed = [f"{o.form} (ΔBIC {o.delta_bic:+.1f})" for o in law.other_forms]
        also = f"; not excluded: {', '.join(listed)}" if listed else ""
        unseen = "; ".join(law.not_observable)
        self._words.setText(
            localised_text(f"{form}{also}. The plot spans the range covered. Not observable: {unseen}.")
        )
