"""No text is cut or lies over another, from the smallest screen to the largest, told by the fonts' own measures."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from PySide6.QtCore import QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QComboBox,
    QLabel,
    QMainWindow,
    QScrollArea,
    QStyle,
    QStyleOptionButton,
    QStyleOptionComboBox,
    QStyleOptionViewItem,
    QWidget,
)

from analysis.collision.effects import CATALOGUE, WIDER_EFFECTS
from analysis.diagnosis.findings.result import Candidate, Verdict
from analysis.drive.catalogue import LAWS
from analysis.drive.curves import drive_curves
from analysis.shot.shot import PlotNote
from app.report.shot_figures import time_zero
from app.session.jobs import Jobs
from app.session.kernels import PIECES
from app.session.session import Session
from app.session.settings import Settings
from app.window.controls import commands
from app.window.controls.theme import DARK, LIGHT, Theme, Tone
from app.window.panels.layout import Layout
from app.window.panels.session_model import FLAGS, VERDICT
from app.window.plots.axis import PlainAxis
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack
from app.words.flags import FLAGS as EVERY_FLAG
from app.words.flags import flags_in_short
from app.words.model_texts import verdict_words
from tests.app import synthetic
from tests.app.on_screen import caption_words, notes_drawn

SMALLEST = (960, 540)
SIZES = (SMALLEST, (1366, 768 - 30), (1920, 1080 - 30))
FULL_HD_AT_150 = (1280, 720 - 30)
LONG = "2026-03-01_rig-a_paper-plate_run-"

EFFECTS = (*CATALOGUE.values(), *WIDER_EFFECTS.values(), *LAWS.values())


class _Nobody:
    """Carries every command out by doing nothing."""

    def __getattr__(self, name):
        return lambda: None


@pytest.fixture(scope="module")
def shots():
    return [synthetic.shot(f"{LONG}{n:03d}", 0.2 + 0.05 * n, n) for n in (1, 2)]


@pytest.fixture(scope="module", params=SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def window(qapp, request, shots):
    main = QMainWindow()
    panels = main.panels = Layout(Theme("light"), main)
    main.setCentralWidget(panels)
    commands.bind(main, (_Nobody(),))
    panels.settings.show_values(Settings().values())
    panels.controls.offer_sources([("bench", "Simulated bench with a flaw")], "bench")
    session = Session()
    entries = [session.add(shot) for shot in shots]
    for n in range(120):
        session.add(synthetic.bare_shot(f"shot-{n:04d}"))
    session.add(shots[0])
    panels.table.show_session(session)
    panels.banner.show_state(
        "ANALYSING", "The recording is saved. You can arm the next shot at any time.", Tone.BUSY, "00:12"
    )
    panels.shot.show_shot(shots[0])
    panels.numbers.show_shot(shots[0], f"Shot 101   {shots[0].name}")
    panels.model.show_shot(shots[0])
    panels.model.show_verdict("quadratic drag on the block + a mode inside the block", Tone.WARNING)
    panels.compare.show_entries(entries)
    panels.diagnosis.show_diagnosis(synthetic.diagnosis(shots[0]), [shots[0]])
    panels.budget.show_shot(shots[0])
    main.resize(*request.param)
    main.show()
    QTest.qWait(30)
    yield main
    main.close()
    main.deleteLater()


def _cut(widget: QWidget) -> str | None:
    """Return the text that has no room in a widget, or None; rich text, text that wraps and elided text have it."""
    metrics = widget.fontMetrics()
    if isinstance(widget, QAbstractButton):
        text, option = widget.text(), QStyleOptionButton()
        option.initFrom(widget)
        needed = metrics.horizontalAdvance(text.replace("&", ""))
        room = widget.style().subElementRect(QStyle.SubElement.SE_PushButtonContents, option, widget).width()
        return text if needed > max(room, widget.width() - 8) else None
    if isinstance(widget, QLabel) and widget.text() and "<" not in widget.text():
        if widget.wordWrap():
            needed_height = widget.heightForWidth(widget.width())
            return widget.text() if needed_height > widget.height() + metrics.descent() else None
        longest = max(metrics.horizontalAdvance(line) for line in widget.text().splitlines())
        return widget.text() if longest > widget.width() + 1 or metrics.height() > widget.height() + 2 else None
    return None


def _shown(window: QMainWindow) -> Iterator[QWidget]:
    for widget in window.findChildren(QWidget):
        if widget.isVisible() and isinstance(widget, QLabel | QAbstractButton) and not isinstance(widget, QComboBox):
            yield widget


def _cut_words(window: QMainWindow) -> set[str]:
    """Return the texts that have no room, once the layout has come to rest: two seconds on a busy machine at most."""

    patience = time.monotonic() + 2.0
    while cut := {text for widget in _shown(window) if (text := _cut(widget)) is not None}:
        if time.monotonic() > patience:
            break
        QTest.qWait(10)
    return cut


def _pages(window: QMainWindow) -> Iterator[int]:
    """Bring one page after the other to the front."""
    for page in range(window.panels.tabs.count()):
        window.panels.tabs.setCurrentIndex(page)
        QTest.qWait(20)
        yield page


def test_the_smallest_screen_holds_the_window(window):
    smallest = window.minimumSizeHint()
    assert smallest.width() <= SMALLEST[0] and smallest.height() <= SMALLEST[1], smallest


def test_no_words_are_cut(window):
    for _ in _pages(window):
        assert not _cut_words(window)


def test_buttons_and_labels_never_lie_over_one_another(window):
    for _ in _pages(window):
        there: dict[QWidget, list[tuple[QRect, str]]] = {}
        for widget in _shown(window):
            there.setdefault(widget.parentWidget(), []).append((widget.geometry(), getattr(widget, "text", str)()))
        over = [
            (one, other)
            for family in there.values()
            for n, (place, one) in enumerate(family)
            for elsewhere, other in family[n + 1 :]
            if one and other and place.intersects(elsewhere)
        ]
        assert not over


def _axis_labels(plot: PlotView) -> Iterator[tuple[QRectF, QRectF, PlainAxis]]:
    """Yield where the words of each axis lie, without the document's margin, and the axis, both in the scene."""
    for axis in plot.scene().items():
        if isinstance(axis, PlainAxis) and axis.isVisible() and axis.label.isVisible() and axis.labelText:
            words = axis.label.boundingRect().adjusted(4, 4, -4, -4)
            yield axis.label.mapRectToScene(words), axis.mapRectToScene(axis.rect()), axis


def test_the_labels_of_axes_are_whole_or_not_there(window):
    asked = 0
    for _ in _pages(window):
        for plot in window.findChildren(PlotView):
            if not plot.isVisible() or plot.visibleRegion().isEmpty():
                continue
            labels = list(_axis_labels(plot))
            for number, (words, axis, item) in enumerate(labels):
                assert plot.mapToScene(plot.viewport().rect()).boundingRect().contains(words), item.labelText
                if item.orientation == "left":
                    assert axis.top() - 2 <= words.top() and words.bottom() <= axis.bottom() + 2, item.labelText
                else:
                    assert axis.left() - 2 <= words.left() and words.right() <= axis.right() + 2, item.labelText
                assert not [other.labelText for place, _, other in labels[number + 1 :] if place.intersects(words)]
            asked += len(labels)
    assert asked


def test_the_tabs_and_the_number_of_a_shot_above_99_are_whole(window):
    tabs = window.panels.tabs.tabBar()
    window.panels.name_shot(123)
    QTest.qWait(20)
    assert tabs.tabRect(tabs.count() - 1).right() <= tabs.width()
    assert not [button for button in tabs.findChildren(QAbstractButton) if button.isVisible()]  # they scroll
    table = window.panels.table
    last = table.model.index(table.model.rowCount() - 1, 0)
    assert table.fontMetrics().horizontalAdvance("123 (100)") < table.table.columnWidth(0) - 8
    assert last.data() == "123"


def _scrolls_across(area: QAbstractScrollArea) -> bool:
    bar = area.horizontalScrollBar()
    return area.isVisible() and bar.isVisible() and bar.maximum() > 0


def test_no_page_is_wider_than_the_window(window):
    panels = window.panels
    shot = panels.diagnosis._shots[0]
    found = synthetic.diagnosis(shot)
    longest_first = sorted(EFFECTS, key=lambda effect: -len(effect.words))  # more are not shown
    every = tuple(Candidate(effect, 3580.0 - 100 * n, -25700.0) for n, effect in enumerate(longest_first))
    named = tuple(replace(found.effects[0], effect=effect) for effect in longest_first[:3])  # in bold, with a tick
    found = replace(found, candidates=every, effects=named)
    kinds = (found, replace(found, verdict=Verdict.UNEXPLAINED), replace(found, laws=(synthetic.learned_law(),)))
    own = (window.width(), window.height())
    # the window's own size last: it is the one that the next test finds
    for size in (FULL_HD_AT_150, own) if own[0] == 1366 else (own,):
        window.resize(*size)
        for page in _pages(window):
            for kind in kinds if page == Layout.DIAGNOSIS else (found,):
                panels.diagnosis.show_diagnosis(kind, [shot])
                QTest.qWait(20)
                areas = [a for a in panels.tabs.currentWidget().findChildren(QScrollArea) if _scrolls_across(a)]
                assert not areas, (size, page, kind.verdict)
                bars = panels.diagnosis.bars
                assert not bars.isVisible() or bars.minimumSizeHint().width() <= bars.width()
                assert not _cut_words(window)
    panels.diagnosis.show_diagnosis(found, [shot])


def test_a_learned_law_says_which_line_is_which(window):
    panel = window.panels.diagnosis
    shot = panel._shots[0]
    panel.show_diagnosis(replace(synthetic.diagnosis(shot), laws=(synthetic.learned_law(),)), [shot])
    curve = panel.law_curve
    assert [words for words, _ in curve._legend.entries] == ["free curve", "± 2 σ", "closed form: exponential"]
    curve.compare.click()
    assert curve._legend.entries[-1][0] == "inverse square" and curve.plot.legend == curve._legend.entries
    curve.compare.click()
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot])


def test_orange_is_what_was_computed_from_a_model_and_nothing_else(window):
    panels, orange = window.panels, QColor(LIGHT.simulated)
    entries = [*panels.compare._legend.entries, *panels.spectrum._legend.entries, *panels.shot.drive.legend()]
    for view in ("whole", "contact", "deflection", "gap", "raw"):
        panels.shot.set_view(view)
        entries += panels.shot._legend.entries
    said = {words for words, look in entries if look.pen(LIGHT).color() == orange}
    assert said and all("simulated" in words or "modelled" in words for words in said), said
    assert all(curve.opts["pen"].color() != orange for curve in panels.live.floor.plot.plot.sampled[:-1])
    panels.shot.set_view("whole")


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=["light", "dark"])
def test_no_overlaid_shot_is_near_the_orange_of_a_model(scheme):
    hue = QColor(scheme.simulated).hue()
    coloured = [c for c in map(QColor, scheme.series) if c.saturation() > 60]
    near = [c.name() for c in coloured if abs((c.hue() - hue + 180) % 360 - 180) < 25]
    assert len(set(scheme.series)) == len(scheme.series) and not near


def test_all_keys_are_read_without_moving_the_sheet_aside(window):
    sheet = window.panels.keys
    sheet.show()
    sheet.place()
    QTest.qWait(30)
    try:
        assert not _scrolls_across(sheet._scroll)
        assert not _cut_words(window)
    finally:
        sheet.hide()


def test_what_is_compiled_at_the_first_start_is_told_whole(window):
    line, jobs = window.panels.work, Jobs()
    for piece in PIECES:
        words = f"first start: compiling {piece.name} (+1)"
        for _ in range(2):
            line.show_work(jobs, words, 0.5)
            QTest.qWait(20)
        assert line.progress.format() == words
    line.show_work(jobs, None, None)
    assert jobs.close()


def test_work_that_has_said_nothing_yet_is_called_by_its_name_alone(window):
    line, jobs, ended = window.panels.work, Jobs(), threading.Event()
    jobs.submit("first start", lambda _, __: ended.wait(10.0))
    try:
        while jobs.current is None:
            QTest.qWait(5)
        line.show_work(jobs, None, None)
        assert line.progress.format() == "first start"
    finally:
        ended.set()
        assert jobs.close()


def test_what_is_being_done_is_never_cut_in_mid_word(window):
    line, long = (
        window.panels.work,
        "joint fit of many shots with the changed model: finding a start for each of them (+12)",
    )
    jobs = Jobs()
    line.show_work(jobs, long, 0.5)
    QTest.qWait(20)
    line.show_work(jobs, long, 0.5)
    shown = line.progress.format()
    assert line.fontMetrics().horizontalAdvance(shown) < line.progress.width()
    assert shown == long or (shown.endswith("…") and line.progress.toolTip() == long)
    line.show_work(jobs, None, None)
    assert jobs.close()


def test_the_numbers_of_an_axis_never_lie_over_one_another(window):
    for _ in _pages(window):
        for plot in window.findChildren(PlotView):
            for item in plot.scene().items() if plot.isVisible() else ():
                if isinstance(item, PlainAxis) and item.orientation == "left" and item.isVisible():
                    (low, high), height = item.range, item.size().height()
                    line = QFontMetricsF(item.font()).height()
                    for spacing, _ in item.tickSpacing(low, high, height) if height > line and high > low else ():
                        assert spacing * height / (high - low) >= line * (1 - 1e-9)


def test_every_flag_has_room_in_its_column(window):
    table = window.panels.table
    words = [flags_in_short([flag, *["x"] * 9]) for flag in EVERY_FLAG]
    widest = max(table.fontMetrics().horizontalAdvance(text) for text in words)
    assert widest < table.table.columnWidth(FLAGS) - 8


def test_every_effects_name_has_room_in_the_column_of_verdicts_and_keeps_its_beginning(window):
    table = window.panels.table
    words = [verdict_words(Verdict.EFFECT_FOUND, (effect, effect), short=True) for effect in EFFECTS]
    widest = max(words, key=table.fontMetrics().horizontalAdvance)
    assert table.fontMetrics().horizontalAdvance(widest) < table.table.columnWidth(VERDICT) - 8, widest
    option = QStyleOptionViewItem()
    index = table.model.index(0, VERDICT)
    table.table.itemDelegateForIndex(index).initStyleOption(option, index)
    assert option.textElideMode == Qt.TextElideMode.ElideRight  # why a shot was not analysed begins with the cause


def test_a_plot_too_low_for_its_label_carries_its_name_inside(window):
    seen = set()
    for page in _pages(window):
        for stack in window.panels.tabs.widget(page).findChildren(TimeStack):
            for plot in stack.plots if stack.isVisible() else ():
                axis = plot.getAxis("left")
                if not plot.isVisible() or plot.size().height() < 4:
                    continue
                whole = axis._label_shown == axis.whole
                assert caption_words(plot.caption) == ("" if whole else f"{plot.title} ({plot.unit})")
                seen.add(whole)
    assert (window.width() >= 1366) in seen  # else nothing was asked


def test_a_usual_shots_numbers_have_room_in_their_columns(window):
    table = window.panels.table
    widths = {
        "v in": "-0.3882814(19)",
        "COR quasi": "0.98729985(50)",
        "COR kin": "0.56350(74)",
        "F max": "0.436073(77)",
        "k_p": "221.383(15)",
    }
    for column, heading in enumerate(c.head for c in table.model.columns if not c.hidden):
        shown = next((text for name, text in widths.items() if heading.startswith(name)), "")
        cells = (
            shown,
            *(str(table.model.index(row, column).data()) for row in (0, 1) if table.model.columns[column].number),
        )
        for text in cells:
            assert table.fontMetrics().horizontalAdvance(text) < table.table.columnWidth(column) - 14, (heading, text)


def test_every_choice_has_room_in_its_box(window):
    window.panels.settings.open()
    window.panels.place_sheets()
    QTest.qWait(20)
    cut = []
    for box in window.findChildren(QComboBox):
        option = QStyleOptionComboBox()
        box.initStyleOption(option)
        part = QStyle.SubControl.SC_ComboBoxEditField
        room = box.style().subControlRect(QStyle.ComplexControl.CC_ComboBox, option, part, box).width()
        words = [box.itemText(index) for index in range(box.count())] if box.isVisible() else []
        cut += [text for text in words if box.fontMetrics().horizontalAdvance(text) > room]
    assert not cut


def test_a_driven_record_is_whole_too(window):
    driven = synthetic.driven_shot()
    panel = window.panels.shot
    before = panel._shot
    panel.show_shot(driven)
    panel.show_drive(driven, drive_curves(driven.motion, driven.fit))
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    try:
        for view in ("whole", "contact", "deflection"):
            panel.set_view(view)
            QTest.qWait(20)
            assert not _cut_words(window)
            plots = [plot for plot in panel.drive.plots if plot.isVisible()]
            assert plots and all(plot.height() > 3 * panel.fontMetrics().lineSpacing() for plot in plots)
    finally:
        panel.show_shot(before)


def test_all_numbers_of_a_shot_are_in_view_from_1366_x_768_on(window):
    numbers = window.panels.numbers
    if window.width() < 1366:
        pytest.skip("the smallest screen scrolls them")
    last = numbers.values["γ_N"]
    foot = last.mapTo(numbers.viewport(), last.rect().bottomLeft()).y()
    assert foot <= numbers.viewport().height(), (foot, numbers.viewport().height())


def test_apply_is_within_reach_on_every_screen(window):
    window.panels.settings.open()
    window.panels.place_sheets()
    QTest.qWait(20)
    apply = window.panels.settings._apply
    assert apply.isVisible() and window.panels.rect().contains(
        QRect(apply.mapTo(window.panels, apply.rect().topLeft()), apply.size())
    )


def test_the_time_that_work_still_takes_is_never_cut(window):
    """It stood behind the name of the work, which had the room: "compiling the diagnosis (+1), 19 s l…"."""
    line, jobs, going_on = window.panels.work, Jobs(), threading.Event()
    long = "joint fit of many shots with the changed model, finding a start for each of them"

    def work(report, _):
        report(long, 0.1)
        going_on.wait(20.0)

    jobs.submit("first start", work)
    jobs.submit("another", lambda _, __: None)
    try:
        while jobs.current is None or not jobs.current.what:
            QTest.qWait(5)
        jobs.current.started_s -= 30.0
        for _ in range(2):  # the bar is as wide as it will be once it is shown
            line.show_work(jobs, None, None)
            QTest.qWait(20)
        shown = line.progress.format()
        assert shown.startswith("first start: joint fit") and " (+1), " in shown and shown.endswith(" left")
        assert line.fontMetrics().horizontalAdvance(shown) < line.progress.width()
    finally:
        going_on.set()
        line.show_work(jobs, None, None)
        assert jobs.close()


def test_the_trend_keeps_its_room_on_a_low_page(window):
    """At 960 x 540 the words under it took all but 15 pixels."""
    panels = window.panels
    panels.tabs.setCurrentIndex(Layout.COMPARE)
    QTest.qWait(30)
    compare = panels.compare
    plots = (compare.trend.plot, *compare.stack.plots)
    assert all(plot.view.height() > 2 * window.fontMetrics().height() for plot in plots)
    hover = compare.trend.toolTip()
    assert compare.repeatability.isVisible() == (hover == "")
    assert "spread" in (hover or compare.repeatability.text()) and not (hover and compare._legend.isVisible())
    assert (window.width() > SMALLEST[0]) == (hover == "")


def test_a_note_in_a_low_plot_is_a_dot_whose_text_is_read_on_hovering(window, shots):
    panels = window.panels
    panels.tabs.setCurrentIndex(Layout.SHOT)
    panels.shot.set_view("whole")
    zero, _ = time_zero(shots[0])
    notes = panels.shot.stack.notes
    notes.show([PlotNote("velocity", zero - 0.03, 0.0, "quiet"), PlotNote("force", zero + 0.01, 0.2, "a knock")])
    QTest.qWait(30)
    try:
        assert [text for text, *_ in notes_drawn(notes)] == ["quiet", "a knock"]
        for drawn in notes._drawn:
            text = drawn._text
            inside = drawn.plot.view.sceneBoundingRect().height() >= 4 * text.boundingRect().height()
            assert drawn.is_whole == inside and drawn.note.text in drawn._dot.toolTip()
        assert (window.width() > SMALLEST[0]) == all(drawn.is_whole for drawn in notes._drawn)
    finally:
        notes.show([])
