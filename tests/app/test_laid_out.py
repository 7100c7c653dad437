"""The window as a whole: every widget has its place, every plot its unit, and all follow a change of colours."""

import re
from dataclasses import replace

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtGui import QBrush, QColor, QPen
from PySide6.QtWidgets import QGraphicsView, QGridLayout, QLabel, QLayout, QPushButton, QWidget

from analysis.drive.curves import drive_curves
from analysis.uncertainty.numbers import NUMBERS
from app.session.session import Session
from app.session.settings_store import SettingsStore
from app.window.controls.theme import DARK, LIGHT, MARKS, Theme, Tone, sized, style_sheet
from app.window.controls.widgets import FlowLayout, set_tone, show_toned, text_label
from app.window.panels.help import Step, Tour
from app.window.panels.layout import Layout
from app.window.panels.numbers import NumbersPanel
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.time_plot import TimeStack
from app.window.presenters.view import HelpPresenter
from instrument.devices.device_search import FoundDevice
from tests.app import synthetic

UNITS = {"MHz", "m/s", "N", "mN", "µN", "µm", "nm", "mm", "V", "", "µm/s", "pm", "mm/s", "dB above 1 V²/Hz"}


@pytest.fixture
def panels(qtbot):
    """Return the panels of a window, each with something to show, in light colours."""
    return _panels(qtbot, LIGHT)


def _panels(qtbot, colours):
    theme = Theme("light")
    theme.colours = colours  # the application's own style sheet takes seconds
    panels = Layout(theme)
    qtbot.addWidget(panels)
    session = Session()
    for index, speed in enumerate((0.2, 0.25), 1):
        session.add(synthetic.shot(f"shot-{index}", speed, index))
    entries = list(session.entries)
    first = entries[0].shot
    panels.table.show_session(session)
    panels.shot.show_shot(first)
    panels.numbers.show_shot(replace(first, flags=("momentum_disagrees", "clipped")))
    panels.model.show_shot(replace(first, fit=replace(first.fit, reduced_chi2=5e3)))
    panels.model.show_verdict("the model lacks quadratic drag", Tone.GOOD)
    panels.banner.show_state("FAULT", "No space left on device.", Tone.BAD)
    panels.compare.show_entries(entries)
    panels.diagnosis.show_diagnosis(synthetic.diagnosis(first), [first])
    panels.budget.show_shot(first)
    panels.setup.show_devices(
        (FoundDevice("hantek6022", "Hantek 6022", "USB", "no permission", "a rule"),), (), "bench"
    )
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)  # what was replaced meanwhile
    return panels


def _laid_out(layout: QLayout):
    for place in range(layout.count()):
        item = layout.itemAt(place)
        if item.widget() is not None:
            yield item.widget()
        elif item.layout() is not None:
            yield from _laid_out(item.layout())


def test_every_widget_has_a_place_in_the_layout_of_what_holds_it(panels):
    over_all = {
        panels.settings,
        panels.setup,
        panels.mapping,
        panels.law,
        panels.keys,
        panels.about,
        panels.messages,
        panels.tour,
        panels.tour._ring,
    }
    astray = []
    for holder in (panels, *panels.findChildren(QWidget)):
        if holder.layout() is None:
            continue
        placed = set(_laid_out(holder.layout())) | (over_all if holder is panels else set())
        for child in holder.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly):
            if child not in placed and not child.isWindow():
                astray.append(f"{type(holder).__name__}: {type(child).__name__} {getattr(child, 'text', str)()!r}")
    assert astray == []


def test_every_button_has_words_and_no_two_widgets_share_a_cell(panels):
    assert [b for b in panels.findChildren(QPushButton) if not b.text().strip()] == []
    shared = []
    for grid in panels.findChildren(QGridLayout):
        cells = [grid.getItemPosition(place)[:2] for place in range(grid.count())]
        if not panels.live.isAncestorOf(grid.parentWidget()):  # whose words "No samples yet" lie over the curves
            shared += [f"{type(grid.parentWidget()).__name__} {cell}" for cell in set(cells) if cells.count(cell) > 1]
    assert shared == []


def test_every_value_axis_has_a_name_and_after_it_a_known_unit(panels):
    driven = synthetic.driven_shot()
    panels.diagnosis.residuals.show_forces(driven, *2 * [drive_curves(driven.motion, driven.fit)])
    plots = [(plot, plot.title, plot.unit) for stack in panels.findChildren(TimeStack) for plot in stack.plots]
    plots += [(view.plot, view.plot.title, view.plot.unit) for view in panels.findChildren(PlainPlot)]
    assert len(plots) > 25
    for plot, title, unit in plots:
        assert unit in UNITS and title not in UNITS, (title, unit)
        assert all(curve.unit in UNITS for curve in plot.sampled if hasattr(curve, "unit"))
        below = plot.getAxis("bottom").labelText
        assert not below or re.fullmatch(r"[^()]+ \((\S+)\)(, .+)?", below), below


def _coloured(panels) -> dict[str, list[str]]:
    """Return the colours that widgets give their own words and frames, and which widgets do."""
    found = {}
    for widget in panels.findChildren(QWidget):
        words = widget.text() if isinstance(widget, QLabel) else "(a frame)"
        for colour in re.findall(r"#[0-9a-f]{6}", widget.styleSheet() + words) if words else ():
            found.setdefault(colour, []).append(f"{type(widget.parent()).__name__}: {words}")
    return found


def _all_of(colours) -> set[str]:
    tones = {colour for pair in colours.tones.values() for colour in pair}
    return {colours.text, colours.faint, colours.accent, *colours.signs.values(), *tones}


def test_a_change_of_colours_reaches_every_word_that_is_coloured(panels):
    assert len(_all_of(LIGHT).intersection(_coloured(panels))) > 2
    panels._theme.colours = DARK
    panels.apply_colours()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    found = _coloured(panels)
    assert {colour: found[colour] for colour in found.keys() & (_all_of(LIGHT) - _all_of(DARK))} == {}
    assert len(_all_of(DARK).intersection(found)) > 2


def test_a_label_has_the_colour_of_its_tone_and_keeps_its_size_in_either_scheme(qapp, qtbot):
    holder, before = QWidget(), qapp.styleSheet()
    qtbot.addWidget(holder)
    label = text_label("", holder, bold=True)
    label.setFont(sized(label.font(), 1.5, bold=True))
    size = label.font().pointSizeF()
    for colours in (LIGHT, DARK):
        qapp.setStyleSheet(style_sheet(colours))
        for tone in Tone:
            show_toned(label, "words", tone)
            assert label.palette().color(label.foregroundRole()).name() == colours.signs[tone]
            assert label.text() == f"{MARKS[tone]} words" and label.font().pointSizeF() == size and label.font().bold()
        set_tone(label, None)
        assert label.palette().color(label.foregroundRole()).name() not in colours.signs.values()
    show_toned(label, "", Tone.BAD)
    assert label.text() == ""
    qapp.setStyleSheet(before)


def test_the_name_of_a_number_in_doubt_is_bold_in_either_scheme_and_until_it_is_in_doubt_no_longer(qapp, qtbot):
    panel, before = NumbersPanel(), qapp.styleSheet()
    qtbot.addWidget(panel)
    shot = synthetic.shot()
    for colours in (LIGHT, DARK):
        for flags in (("momentum_disagrees",), ()):
            panel.show_shot(replace(shot, flags=flags))
            qapp.setStyleSheet(style_sheet(colours))  # as after a change of the system's colours
            doubted = [name for name in panel._names.values() if MARKS[Tone.WARNING] in name.text()]
            assert bool(doubted) is bool(flags)
            for name in panel._names.values():
                name.ensurePolished()
                assert name.font().bold() is (name in doubted)
    qapp.setStyleSheet(before)


def _paints(of: object):
    """Yield the pens, brushes and colours that a plot's item has, with the name of each."""
    named = {**vars(of), **getattr(of, "opts", {})} if hasattr(of, "__dict__") else {}
    asked = ((name, getattr(of, name, None)) for name in ("pen", "brush", "defaultTextColor"))
    named |= {name: ask() for name, ask in asked if callable(ask)}
    for name, value in sorted(named.items(), key=lambda pair: str(pair[0])):
        if isinstance(value, QPen):
            yield name, value.color().name(), value.widthF(), value.style()
        elif isinstance(value, QBrush | QColor):
            yield name, (value.color() if isinstance(value, QBrush) else value).name(QColor.NameFormat.HexArgb)


def _painted(panels) -> list[tuple[object, ...]]:
    """Return what every plot is painted with, item by item."""
    found = []
    for view in panels.findChildren(QGraphicsView):
        holder = type(view.parent()).__name__
        found.append((holder, view.backgroundBrush().color().name()))
        for item in view.scene().items(Qt.SortOrder.AscendingOrder):
            label = getattr(item, "label", "")
            name = f"{type(item).__name__} {label if isinstance(label, str) else ''}"
            found += [(holder, name, *paint) for paint in _paints(item)]
    return found


def test_after_a_change_of_colours_every_plot_is_painted_as_one_made_in_them(panels, qtbot):
    light = _painted(panels)
    panels._theme.colours = DARK
    panels.apply_colours()
    changed, made = _painted(panels), _painted(_panels(qtbot, DARK))
    assert len(changed) == len(made) > 300 and changed != light
    assert [pair for pair in zip(changed, made, strict=True) if pair[0] != pair[1]] == []


def test_what_is_read_from_afar_is_written_largest(panels):
    """Speed, state, clock, verdict, headline, ARM, a step of the tour, the sentence on the state: each a size less."""
    banner, numbers, sheet = panels.banner, panels.numbers, panels.settings
    (title,) = [label for label in sheet.findChildren(QLabel) if label.text() == "Settings"]
    headline = numbers.values[next(row.name for row in NUMBERS if row.headline)]
    ranked = (
        panels.live.numbers["velocity"], banner.word, banner._clock, panels.diagnosis._verdict, headline,
        panels.controls.arm, panels.tour.title, banner.detail, panels.numbers,
    )  # fmt: skip
    sizes = [widget.font().pointSizeF() / panels.font().pointSizeF() for widget in ranked]
    assert sizes[0] < 3.5 and sizes == sorted(set(sizes), reverse=True) and sizes[-1] == 1.0
    assert title.font() == panels.diagnosis._verdict.font() and banner._sign.font() == banner.word.font()
    assert all(widget.font().bold() for widget in ranked[:-2])


def test_live_has_its_curves_to_the_left_its_numbers_to_the_right_and_the_raw_signals_below_them(panels):
    live = panels.live
    (grid,) = [one for one in live.findChildren(QGridLayout) if one.indexOf(live.stack) >= 0]
    tiles = [label.parentWidget() for label in live.numbers.values()]
    places = [grid.getItemPosition(grid.indexOf(widget)) for widget in (live.stack, *tiles, live.raw)]
    (_, left, rows, _), *right = places
    assert left == 0 and {column for _, column, _, _ in right} == {1}
    lines = [row for row, _, _, _ in right]
    assert lines == sorted(set(lines)) and lines[-1] == rows - 1  # the curves reach down to the raw signals' end


@pytest.mark.parametrize("corner", [(0, 0), (1160, 0), (0, 660), (1160, 660), (580, 330)])
def test_a_callout_stays_inside_the_window_and_off_the_widget_that_it_points_at(qtbot, corner):
    page = QWidget()
    qtbot.addWidget(page)
    page.resize(1200, 700)
    target = QWidget(page)
    target.setGeometry(*corner, 40, 40)
    tour = Tour(page)
    page.show()
    tour.steps = [Step(target, "Here", "Words of one line and a half about what is here, and what it is for.")]
    tour.open()
    assert page.rect().contains(tour.geometry())
    assert not tour.geometry().intersects(target.geometry())


def test_each_callout_of_the_tour_shows_all_its_words_inside_the_window(panels, qtbot, tmp_path):
    panels.resize(1300, 850)
    panels.show()
    tour = panels.tour
    HelpPresenter(SettingsStore(tmp_path / "settings.json"), panels, tmp_path, panels).tour.open()
    for _ in tour.steps:
        QCoreApplication.processEvents()
        words = tour._words
        assert words.height() >= words.heightForWidth(words.width()) > 0, words.text()
        assert panels.rect().contains(tour.geometry())
        tour.next()
    assert tour.isHidden()


def test_buttons_without_room_go_to_the_next_line(qtbot):
    row = QWidget()
    qtbot.addWidget(row)
    flow = FlowLayout(row)
    buttons = [QPushButton(row) for _ in range(5)]
    for width, button in zip((60, 80, 70, 40, 90), buttons, strict=True):
        button.setFixedSize(width, 20)
        flow.addWidget(button)
    buttons[1].hide()
    row.resize(190, 300)
    row.show()
    places = [button.geometry().getRect()[:2] for button in buttons if button.isVisible()]
    assert places == [(0, 0), (66, 0), (142, 0), (0, 26)]
    assert flow.heightForWidth(190) == 46 and flow.heightForWidth(1000) == flow.sizeHint().height() == 20
