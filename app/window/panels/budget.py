"""BUDGET: the uncertainty budget of a shot, each number with its sources."""

from collections.abc import Sequence

from PySide6.QtWidgets import QVBoxLayout, QWidget

from analysis.shot import Shot, shown_in
from analysis.uncertainty import COVERAGE_FACTOR, BudgetRow, QuantityBudget, budget
from app.window.panels.tree_table import Line, TreeTable
from app.window.widgets import text_label
from app.words import DASH, number, value_text

COLUMNS = (
    "result / source",
    "value / u(x)",
    "unit",
    "A / type",
    "B / sensitivity",
    "combined / part",
    "expanded / share",
)
STATED = "combined standard uncertainty"


class BudgetPanel(QWidget):
    """The budget of one shot; other shots give the repeatability."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        self._say = text_label("", self, faint=True, wrap=True)
        self.table = TreeTable("Uncertainty budget", COLUMNS, (1, 3, 4, 5, 6), self)
        column.addWidget(self._say)
        column.addWidget(self.table, 1)
        self.show_shot(None)

    def show_shot(self, shot: Shot | None, others: Sequence[Shot] = ()) -> None:
        """Show a shot's budget, or why there is none."""
        found = None if shot is None else budget(shot, others=others)
        if found is None or not found.quantities:
            self._say.setText("No shot yet." if shot is None else f"No budget: {shot.problem or 'no impact was read'}.")
            self.table.show_lines([])
            return
        self._say.setText(
            f"Standard uncertainties; expanded with k = {number(COVERAGE_FACTOR)} (about 95 %). Type A from this "
            "measurement's own scatter, type B stated. Expand a result to see its sources."
            + (" Repeatability is that of the selected shots." if others else "")
        )
        self.table.show_lines([_line(quantity) for quantity in found.quantities])


def _line(q: QuantityBudget) -> Line:
    factor, unit = shown_in(q.unit)
    parts = (number(factor * part, 2) for part in (q.std_a, q.std_b, q.std, q.expanded))
    below = tuple(_part(row, q, factor) for row in q.rows)
    return Line((q.words, value_text(q.quantity, factor), unit, *parts), f"{q.words}: {STATED}", below, True)


def _part(row: BudgetRow, q: QuantityBudget, factor: float) -> Line:
    share = (row.contribution / q.std) ** 2 if q.std > 0.0 else 0.0
    known = row.std is not None
    cells = (
        row.source,
        number(row.std, 3),
        "" if row.unit == "1" else row.unit,
        row.kind,
        number(factor * row.sensitivity, 3),
        number(factor * row.contribution, 2) if known else DASH,
        f"{number(100.0 * share, 2)} %" if known and share >= 1e-4 else "0 %" if known else DASH,
    )
    return Line(cells, row.how)
