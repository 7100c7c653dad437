"""What the operator is shown, as plain text: words, what can be pressed, cells, curves with some of their numbers.

Sizes, fonts and colours are left out, so that the text is the same on any machine; in braces stands how a text is set
apart from the others.  Widgets come in the order of their layout.
"""

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QAbstractItemModel, QModelIndex, Qt
from PySide6.QtGui import QAction, QKeySequence, QTextDocumentFragment
from PySide6.QtWidgets import (
    QAbstractButton,
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGridLayout,
    QLabel,
    QLayout,
    QLineEdit,
    QListWidget,
    QMenu,
    QPlainTextEdit,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QSplitter,
    QStackedWidget,
    QTableView,
    QTabWidget,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from app.window.controls.widgets import ElidedLabel, FoldButton
from app.window.panels.effects import Bar
from app.window.panels.rig import Banner
from app.window.plots.curve import Band
from app.window.plots.framed_plot import Caption, FramedPlot
from app.window.plots.legend import Legend
from app.window.plots.lines import CrispCurve, LineStyle
from app.window.plots.plot_view import PlotView
from app.window.plots.residual_grid import ResidualGrid

DASHES = {Qt.PenStyle.DashLine: " dashed", Qt.PenStyle.DotLine: " dotted", Qt.PenStyle.DashDotLine: " dash-dotted"}
KINDS = (
    QLabel, QAbstractButton, QComboBox, QLineEdit, QProgressBar, QPlainTextEdit, QListWidget, QTreeWidget, QTableView
)  # fmt: skip
_NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
RELATIVE = 1e-3  # by which numbers may differ between machines


def of_widget(widget: QWidget) -> list[str]:
    """Return what is visible of a widget and of all within it, a line each."""
    if not widget.isVisible() or isinstance(widget, Caption):
        return []
    if isinstance(widget, PlotView):
        return _of_view(widget)
    if isinstance(widget, ResidualGrid):
        return _of_grid(widget)
    if isinstance(widget, Legend):
        return [f"legend: {'; '.join(f'{words} ({_look(look)})' for words, look in widget.entries)}"]
    if isinstance(widget, Bar):
        return [f"bar of {widget._share:.4g}{', chosen' if widget._chosen else ''}"]
    if isinstance(widget, QTabWidget):
        heads = [f"{widget.tabText(n)}" for n in range(widget.count())]
        heads[widget.currentIndex()] = f"<{heads[widget.currentIndex()]}>"
        return ["tabs: " + " | ".join(heads), *_within(of_widget(widget.currentWidget()))]
    if isinstance(widget, KINDS):
        return _of_control(widget)
    lines = [line for child in _in_order(widget) for line in of_widget(child)]
    named = [widget.accessibleName(), widget.accessibleDescription()] if isinstance(widget, Banner) else []
    lines = [*(f"{name}" for name in named if name), *lines]
    return ["card", *_within(lines)] if widget.property("card") and lines else lines


def _in_order(widget: QWidget) -> list[QWidget]:
    """Return what a widget holds: first what its layout places, then the rest."""
    if isinstance(widget, QStackedWidget):
        return [widget.currentWidget()]
    if isinstance(widget, QScrollArea):
        return [widget.widget()] if widget.widget() is not None else []
    if isinstance(widget, QSplitter):
        return [widget.widget(place) for place in range(widget.count())]
    placed = list(_placed(widget.layout())) if widget.layout() is not None else []
    children = [child for child in widget.children() if isinstance(child, QWidget) and not child.isWindow()]
    return [*placed, *(child for child in children if child not in placed)]


def _placed(layout: QLayout) -> Iterator[QWidget]:
    """Yield the widgets of a layout from the top left."""
    places = list(range(layout.count()))
    if isinstance(layout, QGridLayout):
        places.sort(key=lambda place: layout.getItemPosition(place)[:2])
    elif isinstance(layout, QFormLayout):
        places.sort(key=lambda place: (layout.getItemPosition(place)[0], layout.getItemPosition(place)[1].value))
    for place in places:
        item = layout.itemAt(place)
        if item is None:
            continue
        if item.widget() is not None:
            yield item.widget()
        elif item.layout() is not None:
            yield from _placed(item.layout())


def in_rows(widget: QWidget) -> list[str]:
    """Return the labels of a grid, each row and side of three columns in one line."""
    grid, found = widget.layout(), {}
    assert isinstance(grid, QGridLayout)
    for place in range(grid.count()):
        row, column, _, _ = grid.getItemPosition(place)
        found.setdefault((column // 3, row), []).append(plain(grid.itemAt(place).widget().text()))
    return [" | ".join(found[at]) for at in sorted(found)]


def _within(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def plain(text: str) -> str:
    """Return markup as text in one line; what is struck through stands between "~~"."""
    struck = re.sub(r"</?s>", "~~", text)
    if ("<" in struck and ">" in struck) or "&" in struck:
        struck = re.sub(r"<(?:td|th|tr)\b[^>]*>", lambda found: f"{found[0]} ", struck)
        struck = QTextDocumentFragment.fromHtml(struck).toPlainText()
    return " / ".join(" ".join(line.split()) for line in struck.splitlines() if line.split())


def _hover(widget: QWidget, *but: str) -> list[str]:
    said = plain(widget.toolTip())
    return _within([f"hover: {said}"]) if said and said not in but else []


def shortened(lines: Sequence[str]) -> list[str]:
    """Return the lines; a hover that says what the one before it says is "hover: the same"."""
    last, found = "", []
    for line in lines:
        bare = line.strip()
        found.append(line.replace(bare, "hover: the same") if bare and bare == last else line)
        last = bare if bare.startswith("hover: ") else last
    return found


def _weight(widget: QWidget) -> str:
    """Return how much a text stands out, whether it is set to the right, and whether it can be copied."""
    said = [name for name in ("heading", "faint") if widget.property(name)]
    said += ["fold"] if isinstance(widget, FoldButton) else []
    said += ["bold"] if widget.font().bold() else []
    if isinstance(widget, QLabel):
        said += ["right"] if widget.alignment() & Qt.AlignmentFlag.AlignRight else []
        said += ["copied"] if widget.textInteractionFlags() & Qt.TextInteractionFlag.TextSelectableByMouse else []
    return f"  {{{', '.join(said)}}}" if said else ""


def _of_control(widget: QWidget) -> list[str]:
    off = "" if widget.isEnabled() else "  (disabled)"
    if isinstance(widget, QLabel):
        text = plain(widget.whole if isinstance(widget, ElidedLabel) else widget.text())
        tone = f"  [{widget.property('tone')}]" if widget.property("tone") else ""
        return [f"{text}{tone}{_weight(widget)}{off}", *_hover(widget, text)] if text else []
    if isinstance(widget, QAbstractButton):
        mark = f"[{'x' if widget.isChecked() else ' '}] " if widget.isCheckable() else ""
        kind = "box" if isinstance(widget, QCheckBox) else "button"
        name = widget.text() or widget.accessibleName()
        said = widget.accessibleName()
        named = f"  named: {said}" if said and said != name else ""
        main = "  (main)" if isinstance(widget, QPushButton) and widget.property("primary") else ""
        main += _weight(widget)
        return [f"{kind}: {mark}{name}{main}{named}{off}", *_hover(widget)] if name else []
    if isinstance(widget, QComboBox):
        items = [f"{widget.itemText(n)} = {widget.itemData(n)}" for n in range(widget.count())]
        chosen = widget.currentText()
        return [f"list {widget.accessibleName()!r}: {chosen}{off}", *_hover(widget), *_within(items)]
    if isinstance(widget, QLineEdit):
        empty = f"  (empty: {widget.placeholderText()})" if not widget.text() and widget.placeholderText() else ""
        return [f"field {widget.accessibleName()!r}: {widget.text()}{empty}{off}", *_hover(widget)]
    if isinstance(widget, QProgressBar):
        share = (widget.value() - widget.minimum()) / (widget.maximum() - widget.minimum())
        said = widget.toolTip() or widget.format()
        return [f"progress {widget.accessibleName()!r}: {share:.3g}  {plain(said)}"]
    if isinstance(widget, QPlainTextEdit):
        return [f"text {widget.accessibleName()!r}:", *_within(widget.toPlainText().splitlines())]
    if isinstance(widget, QListWidget):
        return [f"list {widget.accessibleName()!r}:", *_within([widget.item(n).text() for n in range(widget.count())])]
    if isinstance(widget, QTreeWidget):
        return _of_tree(widget)
    assert isinstance(widget, QTableView)
    return _of_table(widget)


def _of_table(table: QTableView) -> list[str]:
    model = table.model()
    columns = [n for n in range(model.columnCount()) if not table.isColumnHidden(n)]
    heads = {n: f"{model.headerData(n, Qt.Orientation.Horizontal)}{_right(model, n)}" for n in columns}
    lines = [f"table {table.accessibleName()!r}: " + " | ".join(heads.values())]
    header = table.horizontalHeader()
    lines += _hover(header)
    if header.isSortIndicatorShown():
        way = "falling" if header.sortIndicatorOrder() == Qt.SortOrder.DescendingOrder else "rising"
        lines += _within([f"sorted by {heads.get(header.sortIndicatorSection())}, {way}"])
    chosen = {index.row() for index in table.selectionModel().selectedRows()}
    for row in range(model.rowCount()):
        cells = {n: model.index(row, n) for n in columns}
        texts = [_cell(index) for index in cells.values()]
        lines += _within([("* " if row in chosen else "  ") + " | ".join(texts)])
    return lines


def _right(model: QAbstractItemModel, column: int) -> str:
    """Return a sign where a column is set to the right."""
    side = model.headerData(column, Qt.Orientation.Horizontal, Qt.ItemDataRole.TextAlignmentRole)
    return " >" if side is not None and Qt.AlignmentFlag(side) & Qt.AlignmentFlag.AlignRight else ""


def _cell(index: QModelIndex) -> str:
    text, font = str(index.data() or ""), index.data(Qt.ItemDataRole.FontRole)
    return f"~~{text}~~" if font is not None and font.strikeOut() else text


def hovers(table: QTableView, row: int) -> list[str]:
    """Return what hovering over each cell of a row shows, hidden columns too."""
    model = table.model()
    cells = [model.index(row, n) for n in range(model.columnCount())]
    heads = [str(model.headerData(n, Qt.Orientation.Horizontal)) for n in range(len(cells))]
    said = [plain(str(cell.data(Qt.ItemDataRole.ToolTipRole) or "")) for cell in cells]
    return [f"{head}: {cell.data()} : {words}" for head, cell, words in zip(heads, cells, said, strict=True)]


def _of_tree(tree: QTreeWidget) -> list[str]:
    header = tree.header()
    order = [header.logicalIndex(n) for n in range(tree.columnCount())]

    def lines_of(item: QTreeWidgetItem, depth: int) -> Iterator[str]:
        cells = [item.text(n) for n in order]
        mark = ("- " if item.isExpanded() else "+ ") if item.childCount() else "  "
        bold = "  {bold}" if item.font(0).bold() else ""
        yield "    " * depth + mark + " | ".join(cells) + bold
        hover = plain(item.toolTip(0))
        if hover and hover != item.text(0):
            yield "    " * depth + f"      hover: {hover}"
        for place in range(item.childCount()):
            yield from lines_of(item.child(place), depth + 1)

    right = Qt.AlignmentFlag.AlignRight
    head = tree.headerItem()
    heads = [f"{head.text(n)}{' >' if Qt.AlignmentFlag(head.textAlignment(n)) & right else ''}" for n in order]
    rows = [line for n in range(tree.topLevelItemCount()) for line in lines_of(tree.topLevelItem(n), 0)]
    return [f"table {tree.accessibleName()!r}: " + " | ".join(heads), *_within(rows)]


# plots ----------------------------------------------------------------------------------------------------------------


def _look(look: LineStyle | None) -> str:
    if look is None:
        return "not drawn"
    place = f" {look.place}" if look.colour == "series" else ""
    return f"{look.colour}{place}{DASHES.get(look.dash, '')}{f' {look.width} wide' if look.width else ''}"


def _of_view(view: PlotView) -> list[str]:
    said = f" of {view.accessibleDescription()}" if view.accessibleDescription() else ""
    lines = [f"plot {view.accessibleName()!r}{said}", *_hover(view)]
    if view.legend:
        lines += _within([f"legend in pictures: {', '.join(words for words, _ in view.legend)}"])
    for plot in view.plots:
        if plot.isVisible():
            lines += _within(_of_plot(plot, first=plot is view.plots[0]))
    if view.cursors.shown:
        lines += _within(["cursors:", *_within(view.cursors.text().replace("\t", " | ").splitlines())])
    return lines


def _of_plot(plot: FramedPlot, first: bool) -> list[str]:
    """Return axes and content of a plot; x is that of the first: pyqtgraph links the others by their pixels."""
    x, y = plot.view.viewRange()
    bottom = plot.getAxis("bottom")
    words = [bottom.whole] if bottom.style["showValues"] else ["no numbers at x"]
    words += [f"x {_span(*x)}"] if first else []
    lines = [f"{plot.getAxis('left').whole}: {', '.join((*filter(None, words), f'y {_span(*y)}'))}"]
    for curve in plot.sampled:
        if curve.isVisible() and len(curve.samples):
            x, values = curve.between(-math.inf, math.inf) if not hasattr(curve, "grid") else _grid(curve)
            lines += _within([f"curve {curve.label!r}, {_look(curve.look)}{_behind(curve)}: {_numbers(x, values)}"])
    for item in plot.view.childGroup.childItems():
        if item not in plot.sampled and item.isVisible():
            lines += _within(_of_item(item))
    return lines


def _span(low: float, high: float) -> str:
    """Return a range; an end that is zero but for rounding is zero."""
    least = 1e-9 * (high - low)
    return " to ".join(_figure(0.0 if abs(end) < least else end) for end in (low, high))


def _grid(curve: object) -> tuple[np.ndarray, np.ndarray]:
    start, step = curve.grid
    return start + step * np.arange(len(curve.samples)), curve.samples


def _behind(item: pg.GraphicsObject) -> str:
    return " behind" if item.zValue() < 0 else ""


def _figure(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "-"


def _numbers(x: np.ndarray, y: np.ndarray) -> str:
    """Return how many points there are, their range and rms, and five of them."""
    y = np.asarray(y, float)
    seen = np.isfinite(y)
    if not seen.any():
        return f"{len(y)} points, none finite"
    places = np.linspace(0, len(y) - 1, min(5, len(y))).round().astype(int)
    some = "; ".join(f"{_figure(x[n])}, {_figure(y[n])}" for n in places)
    lost = f", {int((~seen).sum())} missing" if not seen.all() else ""
    rms = _figure(float(np.sqrt(np.mean(y[seen] ** 2))))
    return f"{len(y)} points{lost}, {_figure(y[seen].min())} to {_figure(y[seen].max())}, rms {rms}: {some}"


def _of_item(item: object) -> list[str]:
    match item:
        case Band():
            upper = item.edges[0].getData()
            if upper[0] is None or len(upper[0]) == 0:
                return []
            return [f"band: half width {_numbers(*upper)}"]
        case pg.InfiniteLine():
            way = "x" if item.angle == 90 else "y"
            label = getattr(item, "label", None)
            return [f"line at {way} = {_figure(item.value())} {label.format if label is not None else ''}".rstrip()]
        case pg.VTickGroup():
            return [f"line at x = {_figure(x)}" for x in item.xvals]
        case pg.TextItem():
            return [f"words {item.toPlainText()!r} at {_figure(item.pos().x())}, {_figure(item.pos().y())}"]
        case pg.ErrorBarItem():
            if len(item.opts["x"]) == 0:
                return []
            bars = zip(item.opts["x"], item.opts["y"], item.opts["height"], strict=True)
            return ["bars: " + "; ".join(f"{_figure(x)}, {_figure(y)} ± {_figure(h / 2)}" for x, y, h in bars)]
        case pg.ScatterPlotItem():
            points = zip(*item.getData(), strict=True)
            return ["dots: " + "; ".join(f"{_figure(x)}, {_figure(y)}" for x, y in points)] if len(item.data) else []
        case pg.ImageItem() if item.image is not None:
            box, levels = item.mapRectToParent(item.boundingRect()), item.getLevels()
            at = [n // 2 for n in item.image.shape]
            place = f"x {_span(box.left(), box.right())}, y {_span(box.top(), box.bottom())}"
            middle = f"middle {_figure(float(item.image[tuple(at)]))}, mean {_figure(float(np.mean(item.image)))}"
            return [f"picture of {item.image.shape}: {place}, from {_span(*levels)}, {middle}"]
        case CrispCurve():
            x, y = item.getData()
            edge = item.look is not None and item.look.colour == "band_edge"
            return [] if edge or x is None or len(x) == 0 else [f"line, {_look(item.look)}: {_numbers(x, y)}"]
    return []


def _of_grid(grid: ResidualGrid) -> list[str]:
    lines = [f"grid {grid.accessibleName()!r}: {grid.accessibleDescription()}"]
    lines += _within([f"scale: linear to {_figure(grid.scale.linear)}, up to {_figure(grid.scale.most)}"])
    for n, cell in enumerate(grid.cells):
        ends = f"{_figure(cell.time_ms[0])} to {_figure(cell.time_ms[-1])} ms"
        lines += _within([f"{cell.title}: {ends}, noise {_figure(float(np.median(cell.noise_m)))}"])
        over = grid.overlays[n] if n < len(grid.overlays) else None
        curves = {"before": cell.before_m, "after": cell.after_m}
        if over is not None:
            curves |= {"would explain": over.signature_m, "would remain": over.remains_m}
        lines += _within(
            _within([f"{name}: {_numbers(cell.time_ms, y)}" for name, y in curves.items() if y is not None])
        )
    return lines


# menus ----------------------------------------------------------------------------------------------------------------


def of_menu(menu: QMenu) -> list[str]:
    """Return the entries of a menu with their keys."""
    lines = [f"menu: {menu.title()}"] if menu.title() else ["menu"]
    return [*lines, *_within([line for action in menu.actions() for line in _of_action(action)])]


def _of_action(action: QAction) -> list[str]:
    if action.isSeparator():
        return ["---"]
    off = "" if action.isEnabled() else "  (disabled)"
    if action.menu() is not None:
        return [f"{action.text()} >{off}"]
    mark = f"[{'x' if action.isChecked() else ' '}] " if action.isCheckable() else ""
    keys = ", ".join(key.toString(QKeySequence.SequenceFormat.PortableText) for key in action.shortcuts())
    return [f"{mark}{action.text()}{f'  ({keys})' if keys else ''}{off}"]


# comparison -----------------------------------------------------------------------------------------------------------


def same(one: str, other: str) -> bool:
    """Return whether two lines are the same but for numbers that differ by the last bits of a computation."""
    if one == other:
        return True
    if _NUMBER.sub("#", one) != _NUMBER.sub("#", other):
        return False
    pairs = zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
    values = ((float(a.replace("−", "-")), float(b.replace("−", "-"))) for a, b in pairs)
    return all(math.isclose(a, b, rel_tol=RELATIVE) for a, b in values)


def differences(kept: Sequence[str], shown: Sequence[str]) -> list[str]:
    """Return in a line each what is shown differently from what was kept, after the headings above it."""
    import difflib

    keys: list[str] = []  # a line that is the same within the tolerance counts as the kept one

    def key(line: str) -> str:
        found = next((known for known in keys if same(known, line)), None)
        if found is None:
            keys.append(line)
        return found or line

    before, after = [key(line) for line in kept], [key(line) for line in shown]
    found = []
    for what, a, b, c, d in difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if what == "equal":
            continue
        above = _above(kept, a) if what != "insert" else _above(shown, c)
        pairs = max(b - a, d - c)
        for n in range(pairs):
            old = kept[a + n].strip() if a + n < b else "nothing"
            new = shown[c + n].strip() if c + n < d else "nothing"
            found.append(f"{above}: {old}  ->  {new}")
    return found


def _above(lines: Sequence[str], place: int) -> str:
    """Return the less indented lines above a line, the outermost first."""
    if place >= len(lines):
        return ""
    depth = len(lines[place]) - len(lines[place].lstrip())
    found: list[str] = []
    for line in reversed(lines[:place]):
        own = len(line) - len(line.lstrip())
        if own < depth or line.startswith("# "):
            found.insert(0, line.strip()[:60])
            depth = own
        if line.startswith("# "):
            break
    return " > ".join(found)
