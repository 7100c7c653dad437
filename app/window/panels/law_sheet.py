"""The sheet on which an own law is typed: where it acts, formula, parameters; checked while typing."""

from typing import Any

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QCheckBox, QFormLayout, QGridLayout, QLabel, QLineEdit, QWidget

from analysis.collision import FUNCTIONS, MOST_PARAMETERS, LawError, from_mapping
from app.window.theme import Tone
from app.window.widgets import Sheet, added, combo_box, line_edit, push_button, show_toned, text_label
from app.words import typed_number

PLACES = (("on the block", "block"), ("on the plate", "plate"), ("between block and plate, in contact", "contact"))
COLUMNS = (("name", ""), ("unit", ""), ("start", ""), ("lower", "optional"), ("upper", "optional"))
HINT = (
    "A force in N, positive to the right, of: x, v (position and velocity of the block), y, u (of the plate), d, "
    "d_rate (overlap and its rate), t (seconds since the first touch); numbers, pi, + - * / **, "
    f"{' '.join(FUNCTIONS)}. The force must vanish if one of the parameters is 0."
)


class LawSheet(Sheet):
    """The form for an own law; it keeps its content when closed."""

    wanted = Signal(dict)  # the law as a table for ``from_mapping``

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
        for words, editor in (
            ("Name", self.name), ("In words", self.words), ("Where it acts", self.where), ("Formula", self.formula),
        ):  # fmt: skip
            form.addRow(words, editor)
        column.addLayout(form)
        column.addWidget(text_label("PARAMETERS", self, heading=True))
        grid = QGridLayout()
        for place, name in enumerate((*(name for name, _ in COLUMNS), "fitted per shot")):
            grid.addWidget(QLabel(name, self), 0, place)
        for place in range(1 + len(COLUMNS)):
            grid.setColumnStretch(place, (6, 5, 5, 5, 5, 0)[place])  # the name needs most room
        self.own: list[QCheckBox] = []
        self.parameters: list[dict[str, QLineEdit]] = []
        for row in range(1, 1 + MOST_PARAMETERS):
            editors = {name: self._line(f"Parameter {row}, {name}", shown) for name, shown in COLUMNS}
            for place, editor in enumerate(editors.values()):
                grid.addWidget(editor, row, place)
            self.parameters.append(editors)
            own = QCheckBox(self)
            own.setAccessibleName(f"Parameter {row}, fitted per shot")
            own.setToolTip("Each shot has its own value, for example a phase (name it phase_rad)")
            own.toggled.connect(self._check)
            grid.addWidget(own, row, len(COLUMNS))
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
        """Fill the form with an existing law."""
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
            from_mapping(self.table())
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
        """Show a message below the fields."""
        show_toned(self.said, words, tone)

    def open(self) -> None:
        """Show the sheet with the focus in the first empty field."""
        first = next((e for e in (self.name, self.formula) if not e.text()), self.name)
        self.open_at(first)
