"""Panel of a shot's numbers with uncertainty and unit; a tooltip says how each was read."""

import math

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QCheckBox, QGridLayout, QLabel, QScrollArea, QWidget

from analysis.paper import printed_value
from analysis.shot import Quantity, Reading, Shot, flags_affecting
from analysis.uncertainty import Group, ResultNumber, combined_uncertainties, shown_numbers, with_combined_uncertainty
from app.window.controls.commands import with_keys
from app.window.controls.theme import MARKS, Colours, Themed, Tone
from app.window.controls.widgets import (
    FoldButton,
    add_row,
    heading_label,
    push_button,
    set_tone,
    show_toned,
    text_label,
    vertical,
)
from app.window.panels.state_words import flag_line, flag_tone
from app.words import (
    COMBINED,
    DASH,
    NOISE_ONLY,
    by_severity,
    cached_words,
    concise_text,
    effect_numbers,
    flag_words,
    lines,
    localised_number,
    reading_tooltip,
    tag,
    value_text,
)

PAPERS_KINETIC = "cor_kinetic.force_peaks"
WIDE = 0.2  # relative standard uncertainty above which a number is poorly determined


def _effect_lines(shot: Shot | None) -> list[str]:
    """Return the fitted parameters of the effects in the model, one line per effect."""
    fit = shot.fit if shot is not None else None
    if fit is None or not fit.converged:
        return []
    found = []
    for effect in fit.effects:
        prefix = f"{effect.key}."
        own = {name.removeprefix(prefix): q for name, q in fit.parameters.items() if name.startswith(prefix)}
        found.append(f"{effect.words}: {effect_numbers(effect, own)}")
    return found


def wide_words(reading: Reading | None) -> str:
    """Return a remark if the uncertainty of a number is a large part of it, else ""."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value) or not math.isfinite(reading.std):
        return ""
    share = reading.std / abs(reading.value) if reading.value else math.inf
    return f"Poorly determined: ± is {100 * share:.0f} % of the value" if WIDE < share < math.inf else ""


class NumbersPanel(Themed, QScrollArea):
    """The numbers of a shot, each at a fixed place."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shot: Shot | None = None
        self._title = "No shot"
        self._version = ""
        self._combined: dict[str, float] = {}  # combined standard uncertainties of the shot shown, by budget key
        self._groups: dict[Group, list[QWidget]] = {}
        self._rows: list[ResultNumber] = []
        self.values: dict[str, QLabel] = {}
        self._names: dict[str, QLabel] = {}
        self._foldable: list[QWidget] = []  # numbers that a button shows or hides, with their sentences
        inner = QWidget(self)
        column = vertical(inner, (10, 4, 8, 4))
        middle = Qt.TextElideMode.ElideMiddle  # because names of shots differ at their end
        self.title = text_label("No shot", inner, elide=middle, selectable=True, bold=True, size=1.25)
        hover = "Where each ± comes from, source by source"
        self.budget = push_button("Budget", hover, inner, command="show_page:BUDGET")
        add_row(column, self.title, self.budget)
        self.noise_only = QCheckBox("± from noise only", inner)
        hover = "Exclude wavelength, air, mass and clock from the uncertainties"
        self.noise_only.setToolTip(with_keys(hover, "toggle:numbers.noise_only"))
        self.noise_only.toggled.connect(self._uncertainty_chosen)
        grid = QGridLayout()
        grid.setHorizontalSpacing(8)
        grid.setVerticalSpacing(0)
        grid.setColumnStretch(1, 1)
        column.addLayout(grid)
        self._add_groups(grid, inner)
        self.effects = text_label("", inner, selectable=True, wrap=True)  # parameters of the effects in the model
        self.effects.setToolTip(NOISE_ONLY)
        self.flags = text_label("", inner, selectable=True, wrap=True)
        column.addWidget(self.noise_only)  # at the bottom, so that the numbers come first on a low screen
        column.addWidget(self.effects)
        column.addWidget(self.flags)
        column.addStretch(1)
        inner.setProperty("panel", True)
        self.setWidget(inner)
        self.setWidgetResizable(True)
        self.setMinimumWidth(inner.sizeHint().width() + self.verticalScrollBar().sizeHint().width())
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName("Numbers of the shot")
        self.show_shot(None)

    def _add_groups(self, grid: QGridLayout, inner: QWidget) -> None:
        """Add all numbers under the headings of their groups."""
        for group in (group for group in Group if group is not Group.ANALYSIS):
            label = heading_label(group.value, inner)
            if self._rows:  # the first heading needs no space above it
                label.setMinimumHeight(int(1.15 * self.fontMetrics().height()))
            label.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
            grid.addWidget(label, grid.rowCount(), 0, 1, 3)
            members = self._groups[group] = [label]
            for row in shown_numbers(group):
                widgets = self._add_row(grid, row, inner)
                if row.key == "cor_impulse":
                    self.agreement = text_label("", inner, bold=True)
                    self.agreement.setAlignment(Qt.AlignmentFlag.AlignRight)
                    grid.addWidget(self.agreement, grid.rowCount(), 0, 1, 3)
                    widgets.append(self.agreement)
                if row.folded:  # its explanation
                    widgets.append(text_label(row.folded, inner, faint=True, wrap=True))
                    grid.addWidget(widgets[-1], grid.rowCount(), 0, 1, 3)
                    self._foldable += widgets
                elif row.key == PAPERS_KINETIC:
                    widgets += self._add_fold(grid, inner)
                members += widgets

    def _add_row(self, grid: QGridLayout, row: ResultNumber, inner: QWidget) -> list[QWidget]:
        name = QLabel(row.name, inner)
        name.setProperty("quantity", True)
        value = text_label(DASH, inner, selectable=True, bold=True, size=1.4 if row.headline else 1.06)
        unit = text_label(row.shown_unit, inner, faint=True)
        name.setMinimumWidth(name.fontMetrics().horizontalAdvance("kinetic, flights") + 16)  # 16: room for a mark
        value.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        widest = "0.98755567(44)" if row.headline else "-0.987555673(44)"
        value.setMinimumWidth(value.fontMetrics().horizontalAdvance(widest))
        value.setAccessibleName(f"{row.name} {row.shown_unit}")
        line = grid.rowCount()
        for place, label in enumerate((name, value, unit)):
            grid.addWidget(label, line, place)
        self._rows.append(row)
        self.values[row.name], self._names[row.name] = value, name
        return [name, value, unit]

    def _add_fold(self, grid: QGridLayout, inner: QWidget) -> list[QWidget]:
        """Add the remark that one kinetic COR is the paper's, and the button that shows the others."""
        note = text_label(
            f"the paper's ({localised_number(f'{printed_value(PAPERS_KINETIC):.4f}')} there)", inner, faint=True
        )
        note.setToolTip("The paper times T1 and T2 between peaks of the force; PAPER (Ctrl+7) has all its numbers")
        hover = "Show the kinetic COR by onsets, by flights and of the fitted contact"
        others = sum(bool(row.folded) for row in shown_numbers(Group.RESTITUTION))
        self.others = FoldButton(f"{others} other definitions", hover, inner)
        self.others.toggled.connect(self._folded)
        line = grid.rowCount()
        grid.addWidget(note, line, 0)
        grid.addWidget(self.others, line, 1, 1, 2, Qt.AlignmentFlag.AlignRight)
        return [note, self.others]

    @Slot(bool)
    def _folded(self, shown: bool) -> None:
        for widget in self._foldable:
            widget.setVisible(shown and self.others.isVisibleTo(self))

    @Slot()
    def _uncertainty_chosen(self) -> None:
        self.show_shot(self._shot, self._title, self._version)

    def _reading(self, row: ResultNumber) -> Reading | None:
        """Return a number with the chosen uncertainty, combined or from noise alone."""
        return (
            with_combined_uncertainty(row.find(self._shot), row.key, self._combined) if self._shot is not None else None
        )

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._show_flags(self._shot)

    def show_shot(self, shot: Shot | None, title: str = "", version: str = "") -> None:
        """Show the numbers of a shot, or dashes; ``version`` is the program version of a cached result."""
        self._shot, self._version = shot, version
        self._title = title or (shot.name if shot is not None else "No shot")
        self.title.setText(self._title)
        self.title.setToolTip(self._title)
        self._combined = combined_uncertainties(shot) if shot is not None and not self.noise_only.isChecked() else {}
        driven = shot is not None and not shot.settings.collides
        for group, widgets in self._groups.items():
            for widget in widgets:
                widget.setVisible((group is Group.DRIVE) == driven)
        self._folded(self.others.isChecked())
        for row in self._rows:
            reading = self._reading(row)
            label = self.values[row.name]
            label.setText(self._fitting(label, reading, row.scale))
            which = COMBINED if row.key in self._combined else NOISE_ONLY
            doubts = flags_affecting(row.key, shot.flags) if shot is not None else ()
            poor = [wide] if (wide := wide_words(reading)) else []
            hover = lines((reading_tooltip(row.name, reading, row.meaning, which), *map(flag_line, doubts), *poor))
            label.setToolTip(hover)
            self._mark(row, doubts, hover, bool(poor))
            remarks = "; ".join((*map(flag_words, doubts), *poor))
            label.setAccessibleDescription(f"{label.text()} {row.shown_unit} {remarks}".rstrip())
        self.noise_only.setVisible(not driven)  # the numbers of a drive have no budget
        self.budget.setVisible(not driven)
        self.effects.setText("\n".join(_effect_lines(shot)))
        self._show_agreement(shot)
        self._show_flags(shot)

    def _mark(self, row: ResultNumber, doubts: tuple[str, ...], hover: str, wide: bool) -> None:
        """Mark the name of a number that is flagged or poorly determined; a mild flag appears only in the tooltip."""
        name = self._names[row.name]
        doubted = wide or any(flag_tone(flag) is Tone.WARNING for flag in doubts)
        name.setText(f"{row.name} {MARKS[Tone.WARNING]}" if doubted else row.name)
        set_tone(name, Tone.WARNING if doubted else None)
        name.setToolTip(hover)

    @staticmethod
    def _fitting(label: QLabel, reading: Reading | None, scale: float) -> str:
        """Return "0.98755563 ± 0.00000016" if it fits the label, else "0.98755563(16)"."""
        words = value_text(reading, scale)
        if label.fontMetrics().horizontalAdvance(words) <= max(label.width(), label.minimumWidth()):
            return words
        return concise_text(reading, scale)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Reserve the width of the scroll bar, so that nothing moves when it appears."""
        super().resizeEvent(event)
        self.widget().setFixedWidth(self.width() - self.verticalScrollBar().sizeHint().width())
        self.widget().layout().activate()
        for row in self._rows:
            label = self.values[row.name]
            label.setText(self._fitting(label, self._reading(row), row.scale))

    def _show_agreement(self, shot: Shot | None) -> None:
        self.agreement.setText("")
        impact = shot.impact if shot is not None else None
        if impact is None:
            return
        first, second = impact.cor_quasi_static, impact.cor_impulse
        if isinstance(first, Quantity) and isinstance(second, Quantity):
            spread = math.hypot(first.std, second.std)
            apart = abs(first.value - second.value) / spread if spread > 0 else math.inf
            how, tone = ("agree", Tone.GOOD) if apart <= 3 else (f"differ by {apart:.0f} σ", Tone.WARNING)
            show_toned(self.agreement, f"quasi-static and impulse COR {how}", tone)
            self.agreement.setToolTip("Difference between quasi-static and impulse COR, relative to their noise")

    def _show_flags(self, shot: Shot | None) -> None:
        """Show the shot's problem and flags, and the version of a cached result."""
        said: list[tuple[Tone, str]] = []
        if shot is not None and shot.problem:
            said.append((Tone.BAD, f"{MARKS[Tone.BAD]} {shot.problem}"))
        if shot is not None:
            said += [(flag_tone(flag), flag_line(flag)) for flag in by_severity(shot.flags)]
        if self._version:
            said.append(
                (Tone.NEUTRAL, f"{MARKS[Tone.NEUTRAL]} {cached_words(self._version)}; Ctrl+R repeats the analysis")
            )
        signs = self.colours.signs
        self.flags.setText(lines(tag("span", words, style=f"color: {signs[tone]}") for tone, words in said))
