"""Laws: the plot of a learned law, and the sheet on which an own law is typed and checked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QCheckBox, QFormLayout, QGridLayout, QLabel, QLineEdit, QWidget

from analysis.collision import FUNCTIONS, MAX_PARAMETERS, LawError, law_from_table
from analysis.diagnosis import LearnedLaw
from analysis.shot import Shot
from app.report import law_columns
from app.window.controls.theme import Tone
from app.window.controls.widgets import (
    Sheet,
    add_row,
    added,
    combo_box,
    heading_label,
    line_edit,
    push_button,
    show_toned,
    text_label,
    vertical,
)
from app.window.plots.cursors import DISTANCE, CursorAxis, CursorReadout
from app.window.plots.legend import Legend
from app.window.plots.lines import SIMULATED, LineStyle, series
from app.window.plots.plain_plot import PlainPlot
from app.words import localised_text, prefix_for, short_name, typed_number

MAX_FORMS = 4
EDGES, FREE = LineStyle("band_edge", width=1), LineStyle("measured", width=1)
OTHERS = [series(index + 2) for index in range(MAX_FORMS)]


class LawCurve(QWidget):
    """Shows one learned law; if there are two, a button shows the other."""

    keep_wanted = Signal(object)  # the UserLaw to save

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._laws: tuple[LearnedLaw, ...] = ()
        self._which = 0
        column = vertical(self)
        self._heading = heading_label("", self, wrap=True)
        self.other = push_button("The other law", "Two laws were learned; show the other", self, self._turn)
        hover = "Overlay the other closed forms that fit"
        self.compare = push_button("Compare forms", hover, self, self._draw, checkable=True)
        self.keep = push_button("Save law as …", "Save it under a name; later diagnoses include it", self, self._keep)
        add_row(column, self._heading, self.other, self.compare, self.keep)
        self._legend = added(column, Legend(self))
        self.plot = PlainPlot("Learned law", ("force", "mN"), "displacement", DISTANCE, self)
        self._band = [self.plot.add_curve(f"{sign} 2 σ", EDGES) for sign in ("-", "+")]
        self._curve = self.plot.add_curve("free curve", FREE)
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
        legend = [("free curve", FREE), ("± 2 σ", EDGES)]
        legend.append((f"{'closed form' if law.form else 'nearest form'}: {law.nearest_form}", SIMULATED))
        legend += self._show_others(law, x, force_scale)
        self._legend.show_entries(legend)
        self.plot.legend = legend
        self.plot.plot.name_value("force", force_unit)
        self.plot.name_bottom(law.argument, CursorAxis(unit, unit))
        self.plot.columns = {name: np.array(values) for name, values in law_columns(law).items()}
        force = force_scale * law.curve_force_n
        reach = 0.1 * max(float(np.ptp(force)), 1e-9)
        self.plot.show_range((float(x[0]), float(x[-1])), (float(force.min()) - reach, float(force.max()) + reach))
        self._show_words(law)

    def _show_others(self, law: LearnedLaw, x: NDArray[np.float64], force_scale: float) -> list[tuple[str, LineStyle]]:
        """Show the other closed forms that fit, if they are wanted; return their entries in the legend."""
        others = [(one.form, one.curve_force_n) for one in law.other_forms if one.curve_force_n is not None][:MAX_FORMS]
        self.compare.setEnabled(bool(others))
        if not self.compare.isChecked():
            return []
        for curve, (form, force_n) in zip(self._others, others, strict=False):
            curve.label = form
            curve.show_points(x, force_scale * force_n)
        return [(form, look) for (form, _), look in zip(others, OTHERS, strict=False)]

    def _show_words(self, law: LearnedLaw) -> None:
        """Show heading and formula, and what else fits the data."""
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


PLACES = (("on the block", "block"), ("on the plate", "plate"), ("between block and plate, in contact", "contact"))
PARAMETER_COLUMNS = (("name", ""), ("unit", ""), ("start", ""), ("lower", "optional"), ("upper", "optional"))
HINT = (
    "A force in N, positive to the right, of: x, v (position and velocity of the block), y, u (of the plate), d, "
    "d_rate (overlap and its rate), t (seconds since the first touch); numbers, pi, + - * / **, "
    f"{' '.join(FUNCTIONS)}. The force must vanish if one of the parameters is 0."
)


class LawSheet(Sheet):
    """The form for an own law; it keeps its content when closed."""

    wanted = Signal(dict)  # the law as a table for ``law_from_table``

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Propose a law", parent)
        column, _ = self.head("Propose a law", "Close; the entries are kept  (Esc)")
        column.addWidget(text_label(HINT, self, faint=True, wrap=True))
        form = QFormLayout()
        self.name = self._line("Name", "a word of letters, digits and _")
        self.words = self._line("In words", "optional: name in reports")
        hover = "The body on which the force acts; between the two: on the block, reversed on the plate"
        self.where = combo_box("Where it acts", hover, self, PLACES)
        self.formula = self._line("Formula", "-c * v**3")
        for editor in (self.name, self.words, self.where, self.formula):
            form.addRow(editor.accessibleName(), editor)
        column.addLayout(form)
        column.addWidget(heading_label("PARAMETERS", self))
        grid = QGridLayout()
        for place, name in enumerate((*(name for name, _ in PARAMETER_COLUMNS), "fitted per shot")):
            grid.addWidget(QLabel(name, self), 0, place)
        for place in range(1 + len(PARAMETER_COLUMNS)):
            grid.setColumnStretch(place, (6, 5, 5, 5, 5, 0)[place])  # the name needs most room
        self.own: list[QCheckBox] = []
        self.parameters: list[dict[str, QLineEdit]] = []
        for row in range(1, 1 + MAX_PARAMETERS):
            editors = {name: self._line(f"Parameter {row}, {name}", shown) for name, shown in PARAMETER_COLUMNS}
            for place, editor in enumerate(editors.values()):
                grid.addWidget(editor, row, place)
            self.parameters.append(editors)
            own = QCheckBox(self)
            own.setAccessibleName(f"Parameter {row}, fitted per shot")
            own.setToolTip("Each shot has its own value, for example a phase (name it phase_rad)")
            own.toggled.connect(self._check)
            grid.addWidget(own, row, len(PARAMETER_COLUMNS))
            self.own.append(own)
        column.addLayout(grid)
        self.said = added(column, text_label("", self, wrap=True, bold=True))
        self.said.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        column.addStretch(1)
        hover = "Save the law in your folder of laws and diagnose the selected shots with it"
        self.save = added(column, push_button("Save and diagnose", hover, self, self._save, primary=True))
        self.where.currentIndexChanged.connect(self._check)
        for line in self.findChildren(QLineEdit):
            line.textChanged.connect(self._check)
        self._check()

    def _line(self, name: str, shown: str) -> QLineEdit:
        return line_edit(name, shown or name, self, shown)

    def fill(self, table: dict[str, Any]) -> None:
        self.name.setText(table["name"])
        self.words.setText(table.get("words", ""))
        self.where.setCurrentIndex(self.where.findData(table["where"]))
        self.formula.setText(table["formula"])
        parameters = list(table["parameters"].items())
        for row, editors in enumerate(self.parameters):
            name, values = parameters[row] if row < len(parameters) else ("", {})
            editors["name"].setText(name)
            for key in ("unit", "start", "lower", "upper"):
                value = values.get(key, "")
                editors[key].setText(value if isinstance(value, str) else f"{value:.6g}")
            self.own[row].setChecked(bool(values.get("own", False)))

    def table(self) -> dict[str, Any]:
        """Return the typed law as a table.  Raises ValueError for an invalid number or a repeated parameter."""
        table: dict[str, Any] = {
            "name": self.name.text().strip(),
            "where": str(self.where.currentData()),
            "formula": self.formula.text().strip(),
        }
        if self.words.text().strip():
            table["words"] = self.words.text().strip()
        table["parameters"] = {}
        for editors, own in zip(self.parameters, self.own, strict=True):
            name = editors["name"].text().strip()
            if not name:
                continue
            if name in table["parameters"]:
                raise ValueError(f"parameters: {name!r} occurs twice")
            entry: dict[str, Any] = {"unit": editors["unit"].text().strip()}
            for key in ("start", "lower", "upper"):
                typed = editors[key].text().strip()
                if typed:
                    try:
                        entry[key] = typed_number(typed)
                    except ValueError as error:
                        raise ValueError(f"parameters.{name}.{key}: {error}") from None
            if own.isChecked():
                entry["own"] = True
            table["parameters"][name] = entry
        return table

    @Slot()
    def _check(self) -> None:
        if not self.name.text().strip() and not self.formula.text().strip():
            self.save.setEnabled(False)
            self.say("", Tone.NEUTRAL)
            return
        try:
            law_from_table(self.table())
        except (LawError, ValueError) as error:
            self.save.setEnabled(False)
            self.say(str(error), Tone.WARNING)
            return
        self.save.setEnabled(True)
        self.say("Formula is valid", Tone.GOOD)

    @Slot()
    def _save(self) -> None:
        self.wanted.emit(self.table())

    def say(self, words: str, tone: Tone) -> None:
        show_toned(self.said, words, tone)

    def open(self) -> None:
        """Show the sheet with the focus in the first empty field."""
        first = next((e for e in (self.name, self.formula) if not e.text()), self.name)
        self.open_at(first)
