"""The settings sheet, made from the declarations of the settings; checked and applied as a whole."""

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QCheckBox, QComboBox, QFormLayout, QLineEdit, QScrollArea, QSizePolicy, QWidget

from analysis.uncertainty import with_unit
from app.session import FIELDS
from app.window.controls.file_dialog import PathKind, ask
from app.window.controls.theme import Tone
from app.window.controls.widgets import (
    Sheet,
    added,
    combo_box,
    heading_label,
    horizontal,
    push_button,
    show_toned,
    text_label,
)
from app.words import localised_number, typed_number, typed_numbers
from levimass import Setting, Value

NUMERIC = ("number", "numbers")  # kinds of settings


class SettingsSheet(Sheet):
    """The form of all settings, by group."""

    applied = Signal(dict)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Settings", parent)
        self._editors: dict[str, QWidget] = {}
        column, _ = self.head("Settings", "Close without applying  (F2 or Esc)")
        hint = "Settings apply to the next shots; each shot keeps the settings with which it was taken."
        column.addWidget(text_label(hint, self, faint=True, wrap=True))
        self._scroll = added(column, QScrollArea(self), 1)
        self._scroll.setAccessibleName("Fields of the settings")
        self._scroll.setWidgetResizable(True)
        self._scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._add_fields()
        self.problem = added(column, text_label("", self, wrap=True, bold=True))
        self.problem.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        hover = "Apply these settings from the next shot on  (Enter in a field)"
        self._apply = added(column, push_button("Apply", hover, self, self.apply, primary=True))

    def _add_fields(self) -> None:
        inner = QWidget(self)
        form = QFormLayout(inner)
        form.setContentsMargins(0, 4, 12, 4)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        group = ""
        for field in FIELDS:
            if field.group != group:
                group = field.group
                form.addRow(heading_label(group.upper(), inner))
            editor = self._editor(field, inner)
            editor.setToolTip(field.hover)
            label = with_unit(field.words, field.unit)
            editor.setAccessibleName(label)
            self._editors[field.key] = editor
            if field.kind == "flag":
                form.addRow("", editor)
            elif field.kind == "folder":
                form.addRow(label, self._with_browse(editor, inner))
            else:
                form.addRow(label, editor)
        inner.setProperty("panel", True)
        self._scroll.setWidget(inner)

    def _editor(self, field: Setting, inner: QWidget) -> QWidget:
        if field.kind == "choice":
            box = combo_box(field.words, field.hover, inner, [(words, stored) for stored, words in field.choices])
            box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(12)
            box.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            return box
        if field.kind == "flag":
            return QCheckBox(field.words, inner)
        line = QLineEdit(inner)
        if field.kind == "number":
            line.setPlaceholderText("not given" if field.optional else "")
            line.setMinimumWidth(line.fontMetrics().horizontalAdvance("632.99135400000"))
        line.returnPressed.connect(self.apply)
        return line

    def _with_browse(self, editor: QWidget, inner: QWidget) -> QWidget:
        row = QWidget(inner)
        line = horizontal(row)
        browse = push_button("…", "Choose a folder", row, self._browse, editor)
        browse.setAccessibleName("Choose a folder")
        line.addWidget(editor, 1)
        line.addWidget(browse)
        return row

    def _browse(self, editor: QLineEdit) -> None:
        ask(self, "Choose a folder", PathKind.FOLDER, lambda folder: editor.setText(str(folder)), editor.text())

    def show_values(self, values: dict[str, Value]) -> None:
        self.problem.setText("")
        for field in FIELDS:
            editor, value = self._editors[field.key], values.get(field.key)
            if isinstance(editor, QComboBox):
                editor.setCurrentIndex(max(0, editor.findData(value)))
            elif isinstance(editor, QCheckBox):
                editor.setChecked(bool(value))
            elif isinstance(editor, QLineEdit):
                editor.setText(as_typed(field, value))

    @Slot()
    def apply(self) -> None:
        """Check all fields; emit the values if they are valid, else show the first error."""
        values: dict[str, Value] = {}
        for field in FIELDS:
            editor = self._editors[field.key]
            if isinstance(editor, QComboBox):
                values[field.key] = str(editor.currentData())
            elif isinstance(editor, QCheckBox):
                values[field.key] = editor.isChecked()
            elif isinstance(editor, QLineEdit):
                try:
                    values[field.key] = stored_value(field, editor.text())
                except ValueError as error:
                    self.refuse(f"{field.words}: {error}")
                    editor.setFocus()
                    return
        words = "Applied. Ctrl+R analyses the selected shots again with them, as copies."
        show_toned(self.problem, words, Tone.GOOD)
        self.applied.emit(values)

    def refuse(self, problem: str) -> None:
        show_toned(self.problem, problem, Tone.BAD)

    def open(self) -> None:
        self.open_at(next(iter(self._editors.values()), None))


def as_typed(field: Setting, value: Value) -> str:
    """Return a stored value as the text of its field."""
    if value is None:
        return ""
    if field.kind not in NUMERIC:
        return str(value)
    return "  ".join(localised_number(f"{float(number) * field.scale:.10g}") for number in str(value).split())


def stored_value(field: Setting, text: str) -> Value:
    """Return the text of a field as the value to store.  Raises ValueError."""
    if field.kind not in NUMERIC:
        return text.strip()
    stored: Value = None
    if field.kind == "numbers":
        stored = " ".join(f"{_in_si(field, value):.12g}" for value in typed_numbers(text))
    elif text.strip():
        stored = _in_si(field, typed_number(text))
    if stored in (None, "") and not field.optional:
        raise ValueError("a number is missing")
    return stored


def _in_si(field: Setting, value: float) -> float:
    """Return a number in SI units.  Raises ValueError if it is outside the field's limits."""
    stored = value / field.scale
    if not field.low <= stored <= field.high:
        low, high = field.low * field.scale, field.high * field.scale
        raise ValueError(localised_number(f"{value:g} is outside {low:g} to {high:g} {field.unit}"))
    return stored
