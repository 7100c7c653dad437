"""The sheet on which the operator assigns the channels of a foreign file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QCheckBox, QComboBox, QFormLayout, QLineEdit, QWidget

from analysis.shot import Role, Setup
from analysis.uncertainty import with_unit
from app.session import FIELDS, ChannelKind, ChannelSummary, proposed_roles
from app.window.controls.theme import Tone
from app.window.controls.widgets import (
    Sheet,
    added,
    combo_box,
    fill_box,
    line_edit,
    push_button,
    show_toned,
    text_label,
)
from app.window.panels.settings_sheet import as_typed, stored_value
from app.words import Markup, joined, lines, number, tag
from instrument.files import (
    LENGTHS_M,
    TABLE,
    WITHOUT_FORCE,
    ForeignChannel,
    ForeignContents,
    ForeignMapping,
    MappedChannel,
    MotionColumns,
    length_unit,
)
from levimass import Setting

ROLES = {  # role -> (label, tooltip)
    Role.MEASUREMENT: (
        "PD1, moving beat",
        "Measurement beat, from the moving block; required",
    ),
    Role.REFERENCE: (
        "PD0, rest beat",
        "Reference beat, from the fixed mirror; subtracted from PD1, so that laser drift is not read as motion",
    ),
    Role.SWITCH: (
        "Light switch",
        "Its step marks the passage of the block; without it the program searches for the impact",
    ),
}
NONE = "not in this file"
UNIT_ITEMS = [(unit.replace("u", "µ"), unit) for unit in LENGTHS_M]
MODEL_ITEMS = [(f"{model.name}: {model.bodies}", model.in_record) for model in reversed(WITHOUT_FORCE)]
_DECLARED = {setting.key: setting for setting in FIELDS}
_REST_HOVER = "The beat of the block at rest, at which the velocity is zero"
_RATE_HOVER = "Samples per second; every time and velocity scales with it"
_BITS_HOVER = "Resolution of the digitizer, for the quantisation noise"
NUMBERS = {  # key -> (declaration, placeholder)
    "mass_kg": (replace(_DECLARED["moving_mass_kg"], optional=True), ""),
    "rest_hz": (replace(_DECLARED["rest_frequency_hz"], hover=_REST_HOVER), "only without PD0"),
    "rate_hz": (
        replace(_DECLARED["sample_rate_hz"], low=1e-3, hover=_RATE_HOVER, optional=True), "as the file says"
    ),
    "bits": (
        Setting("", "Bits of the digitizer", "number", low=1.0, high=16.0, hover=_BITS_HOVER, optional=True), ""
    ),
}  # fmt: skip


def _look_words(look: ChannelSummary) -> Markup:
    """Return a line on one channel: kind of signal, beat frequency, amplitude."""
    parts = [str(look.kind), f"amplitude {number(look.amplitude, 3)}"]
    if look.low is not None and look.high is not None and look.in_hz:
        span = number(1e-6 * look.low, 4)
        if look.kind is ChannelKind.MOVING:
            span = f"{span} to {number(1e-6 * look.high, 4)}"
        parts.insert(1, f"{span} MHz")
    return joined(tag("b", look.name), f": {', '.join(parts)}")


def _channel_words(channel: ForeignChannel) -> str:
    unit = f", {channel.unit}" if channel.unit else ""
    return f"{channel.name}   ({channel.samples} samples, {channel.kind}{unit})"


class MappingSheet(Sheet):
    """The form: roles of one file's channels, and numbers that the file does not contain."""

    applied = Signal(object, bool)  # a ForeignMapping or MotionColumns; whether for every file of its folder

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Channels of a file from another program", parent)
        self._contents: ForeignContents | None = None
        column, _ = self.head("Assign channels", "Do not open this file  (Esc)")
        self._file = added(column, text_label("", self, wrap=True))
        self._looks = added(column, text_label("", self, selectable=True, wrap=True))
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        self.boxes = {role: self._box(form, *words) for role, words in ROLES.items()}
        self.displacement = self._box(form, "Displacement", "A column that is the motion itself, already demodulated")
        self.displacement.currentIndexChanged.connect(self._chosen)
        self.unit = self._box(form, "Displacement in", "As the header states it; choose where it states none")
        self.model = self._box(form, "Base model", "Model of what the block hits")
        fill_box(self.model, MODEL_ITEMS)
        self.edits: dict[str, QLineEdit] = {}
        for key, (setting, shown) in NUMBERS.items():
            words = with_unit(setting.words, setting.unit)
            self.edits[key] = edit = line_edit(words, setting.hover, self, shown)
            edit.returnPressed.connect(self.apply)
            form.addRow(words, edit)
        column.addLayout(form)
        self.for_folder = added(column, QCheckBox("for every file of this format in its folder", self))
        self.for_folder.setToolTip("The other files there have the same channels: do not ask again")
        self.problem = added(column, text_label("", self, wrap=True, bold=True))
        self.problem.setMinimumHeight(3 * self.fontMetrics().lineSpacing())
        hover = "Save the assignment with the file, and open the file  (Enter in a field)"
        column.addWidget(push_button("Save and open", hover, self, self.apply, primary=True))
        column.addStretch(1)

    def _box(self, form: QFormLayout, words: str, hover: str) -> QComboBox:
        box = combo_box(words, hover, self)
        form.addRow(words, box)
        return box

    @Slot()
    def _chosen(self) -> None:
        """Enable the fields for a displacement or those for beats; preselect the unit named in the header."""
        name = self.displacement.currentData()
        moved = name is not None
        self.unit.setEnabled(moved)
        self.model.setEnabled(moved)
        for widget in (*self.boxes.values(), self.edits["rest_hz"], self.edits["bits"], self.for_folder):
            widget.setDisabled(moved)
        unit = length_unit(self._contents.channel(name)) if moved and self._contents is not None else None
        unknown = [("choose" if moved else "", None)] if unit is None else []
        fill_box(self.unit, [*unknown, *UNIT_ITEMS], unit)

    def ask(
        self, contents: ForeignContents, mass_kg: float, rest_hz: float | None, looks: Sequence[ChannelSummary] = ()
    ) -> None:
        """Show the form for a file, with the assignment proposed from its channels' ``looks``."""
        self._contents = contents
        self.problem.setText("")
        said = f" ({contents.format}). The assignment is saved with the file."
        self._file.setText(joined(tag("b", contents.path.name), said))
        self._looks.setText(lines(map(_look_words, looks)))
        self._looks.setVisible(bool(looks))
        proposal = proposed_roles(looks)
        self._offer_roles(contents, proposal)
        length = self._offer_displacement(contents, bool(proposal))
        self._chosen()
        for key, value in (("mass_kg", mass_kg), ("rest_hz", rest_hz), ("rate_hz", None), ("bits", 16)):
            self.edits[key].setText(as_typed(NUMBERS[key][0], value))
        self.open_at(self.unit if length is not None else self.boxes[Role.MEASUREMENT])

    def _offer_roles(self, contents: ForeignContents, proposal: Mapping[Role, str]) -> None:
        """Offer all channels for each role, preselected as proposed, else one each, in order."""
        items = [(_channel_words(channel), channel.name) for channel in contents.channels]
        proposed = proposal or dict(zip(self.boxes, (name for _, name in items), strict=False))
        for role, box in self.boxes.items():
            absent = [(NONE, None)] if role is not Role.MEASUREMENT else []
            fill_box(box, [*absent, *items], proposed.get(role))

    def _offer_displacement(self, contents: ForeignContents, beats: bool) -> str | None:
        """Offer a table's columns as the displacement; preselect and return the first length if there are no beats."""
        columns = contents.channels if contents.path.suffix.lower() == TABLE else ()
        length = None if beats else next((column.name for column in columns if length_unit(column)), None)
        fill_box(self.displacement, [(NONE, None), *((column.name, column.name) for column in columns)], length)
        return length

    def refuse(self, problem: str) -> None:
        show_toned(self.problem, problem, Tone.BAD)

    @Slot()
    def apply(self) -> None:
        """Emit the assignment, or show what is missing."""
        contents = self._contents
        if contents is None:
            return
        try:
            if self.displacement.currentData() is not None:
                self.applied.emit(self._columns(), False)
            else:
                self.applied.emit(self._mapping(contents), self.for_folder.isChecked())
        except ValueError as error:
            self.refuse(str(error))

    def _columns(self) -> MotionColumns:
        unit = self.unit.currentData()
        if unit is None:
            raise ValueError("the unit of the displacement is missing")
        name, model = self.displacement.currentData(), self.model.currentData()
        return MotionColumns(str(name), unit, model, self._number("mass_kg"), self._number("rate_hz"))

    def _mapping(self, contents: ForeignContents) -> ForeignMapping:
        chosen = {role: box.currentData() for role, box in self.boxes.items() if box.currentData() is not None}
        if len(set(chosen.values())) < len(chosen):
            raise ValueError("one channel cannot have two roles")
        mass, rest, rate, bits = (self._number(key) for key in NUMBERS)
        if mass is None:
            raise ValueError("the moving mass is missing")
        if Role.REFERENCE not in chosen and rest is None:
            raise ValueError("without PD0 the rest frequency is needed")
        setup = Setup(mass, rest_frequency_hz=rest, digitizer_bits=round(bits or 16))
        return ForeignMapping(
            contents.format, tuple(MappedChannel(role, str(name)) for role, name in chosen.items()), setup, rate
        )

    def _number(self, key: str) -> float | None:
        setting, _ = NUMBERS[key]
        try:
            value = stored_value(setting, self.edits[key].text())
        except ValueError as error:
            raise ValueError(f"{setting.words}: {error}") from None
        return float(value) if value is not None else None
