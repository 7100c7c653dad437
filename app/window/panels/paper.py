"""PAPER: the paper's numbers compared with this program's; a line unfolds into the cause of a difference."""

from PySide6.QtWidgets import QVBoxLayout, QWidget

from analysis.paper import Reproduction, Status
from analysis.shot import Quantity
from app.report import SECTIONS, cells, readable_unit
from app.window.panels.tree_table import Line, TreeTable
from app.window.theme import Colours, Tone
from app.window.widgets import text_label
from app.words import concise_text, local

COLUMNS = ("number", "paper", "as printed", "simulated", "recomputed", "recording", "difference")
RECORDED = COLUMNS.index("recording") - 1
_TONES = {Status.AGREES: Tone.GOOD, Status.TRACED: Tone.GOOD, Status.OPEN: Tone.BAD}


class PaperPanel(QWidget):
    """The table of the comparison."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._result: Reproduction | None = None
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        self._say = text_label("", self, wrap=True)
        self.table = TreeTable("The paper, reproduced and audited", COLUMNS, (1, 2, 3, 4, 5), self)
        self.table.header().moveSection(COLUMNS.index("difference"), 1)  # visible also where the page is narrow
        column.addWidget(self._say)
        column.addWidget(self.table, 1)

    def dress(self, colours: Colours) -> None:
        self._colours = colours
        if self._result is not None:
            self.show_reproduction(self._result)

    def say(self, words: str) -> None:
        """Show a message above the table."""
        self._say.setText(words)

    @property
    def words(self) -> str:
        """Get the line above the table."""
        return self._say.text()

    def show_reproduction(self, result: Reproduction) -> None:
        """Show the comparison, a line per section."""
        self._result = result
        count = {status: sum(row.status is status for row in result.rows) for status in Status}
        recording = f" Recording: {result.recording}." if result.recording else ""
        self._say.setText(
            f"{result.authors}: {result.title}. {count[Status.AGREES]} numbers agree as printed, "
            f"{count[Status.TRACED]} were traced, {count[Status.OPEN]} remain open.{recording}"
        )
        lines = []
        for section, words in SECTIONS.items():
            parts = []
            for row in (row for row in result.rows if row.section == section):
                texts = cells(row)
                shown = [local(text) if "." in text and not text.isalpha() else text for text in texts[1:]]
                if isinstance(row.recorded, Quantity):
                    shown[RECORDED] = concise_text(row.recorded, readable_unit(row)[0])
                trace = (Line((row.traced_to, *[""] * 6)),) if row.traced_to else ()
                tone = _TONES.get(row.status)
                colour = self._colours.signs[tone] if tone is not None else None
                parts.append(Line((texts[0], *shown), row.traced_to, trace, colour=colour))
            lines.append(Line((words, *[""] * 6), "", tuple(parts), True))
        self.table.show_lines(lines)
        for index in range(self.table.topLevelItemCount()):
            section_item = self.table.topLevelItem(index)
            section_item.setExpanded(True)
            section_item.setFirstColumnSpanned(True)
            for place in range(section_item.childCount()):
                for trace_index in range(section_item.child(place).childCount()):
                    section_item.child(place).child(trace_index).setFirstColumnSpanned(True)
        self.table.fit_columns()
