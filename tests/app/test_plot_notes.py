"""Notes that the operator writes on the plots of a shot: by hand and key, kept, undone, drawn and printed."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from analysis.drive.curves import drive_curves
from analysis.shot.recording import Role
from analysis.shot.shot import PLOT_UNITS, PlotNote
from app.report.page import report_of
from app.report.shot_figures import time_zero
from app.session.session import Session
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.panels.shot_raw import curves_of
from app.window.plots.plot_notes import NoteEditor
from app.window.plots.save import save_png, save_svg
from app.window.presenters.selection import PlotNotesPresenter
from tests.analysis.signal.beats import free_flight, make_recording
from tests.app import synthetic
from tests.app.on_screen import notes_drawn

BOUNCE = PlotNote("force", 0.0123, 20.0, "second bounce looks low")


@pytest.fixture
def session(tmp_path):
    session = Session(tmp_path / "session.json")
    for index in (1, 2):
        session.add(replace(synthetic.shot(f"shot-{index}", 0.2, index), path=f"/data/shot-{index}.sigmf-meta"))
    return session


@pytest.fixture
def panels(qtbot, session):
    layout = Layout(Theme("light"))
    qtbot.addWidget(layout)
    layout.resize(1400, 900)
    layout.show()
    qtbot.waitExposed(layout)
    layout.presenter = PlotNotesPresenter(session, layout, lambda: session.entry(layout.in_front), layout)
    layout.in_front = 1
    layout.tabs.setCurrentIndex(Layout.SHOT)
    layout.shot.show_shot(session.entry(1).shot)
    layout.presenter.refresh()
    qtbot.wait(50)
    return layout


def _pixels(view, plot, x, y) -> QPoint:
    return view.mapFromScene(plot.view.mapViewToScene(plot.view.viewRect().center().__class__(x, y)))


def _editor(view) -> NoteEditor:
    (editor,) = [e for e in view.findChildren(NoteEditor) if e.isVisible()]
    return editor


def _action(view, at, words):
    (action,) = [a for a in view.menu(at).actions() if a.text() == words]
    return action


def test_a_note_is_written_edited_and_removed_at_its_place(panels, session, qtbot):
    stack, force = panels.shot.stack, panels.shot.motion.force
    (left, right), (bottom, top) = force.view.viewRange()
    x, y = left + 0.3 * (right - left), bottom + 0.6 * (top - bottom)
    at = _pixels(stack, force, x, y)
    _action(stack, at, "Write a note here").trigger()
    qtbot.keyClicks(_editor(stack), "a knock")
    qtbot.keyClick(_editor(stack), Qt.Key.Key_Return)
    (note,) = session.entry(1).plot_notes
    zero, _ = time_zero(session.entry(1).shot)
    assert (note.plot, note.text) == ("force", "a knock")
    width, height = force.view.viewPixelSize()
    assert note.x == pytest.approx(1e-3 * x + zero, abs=1e-3 * width)  # where it was pressed, to a pixel, in seconds
    assert note.y == pytest.approx(y, abs=height)
    ((text, drawn_x, drawn_y),) = notes_drawn(stack.notes)
    assert (text, drawn_x, drawn_y) == ("a knock", pytest.approx(x, abs=width), pytest.approx(y, abs=height))

    qtbot.mouseDClick(stack.viewport(), Qt.MouseButton.LeftButton, pos=at)
    qtbot.keyClick(_editor(stack), Qt.Key.Key_End)
    qtbot.keyClicks(_editor(stack), " at the table")
    qtbot.keyClick(_editor(stack), Qt.Key.Key_Return)
    assert session.entry(1).plot_notes == (replace(note, text="a knock at the table"),)

    _action(stack, at, "Edit the note").trigger()
    qtbot.keyClicks(_editor(stack), "left again")
    qtbot.keyClick(_editor(stack), Qt.Key.Key_Escape)
    assert session.entry(1).plot_notes[0].text == "a knock at the table"

    _action(stack, at, "Remove the note").trigger()
    assert session.entry(1).plot_notes == () and notes_drawn(stack.notes) == []
    session.undo()
    panels.presenter.refresh()
    assert [text for text, *_ in notes_drawn(stack.notes)] == ["a knock at the table"]


def test_the_line_for_a_note_opens_where_it_was_pressed_and_wholly_inside_the_plot(qtbot):
    plot = QWidget()
    qtbot.addWidget(plot)
    plot.resize(900, 300)
    editor = NoteEditor("", plot)
    for x, y in ((100, 150), (0, 0), (899, 299), (0, 299)):
        editor.place(QPointF(x, y))
        around = editor.geometry()
        assert plot.rect().contains(around) and around.contains(QPoint(x, y))
        free = 0 < x < plot.width() - around.width()  # away from the edges it begins at the place itself
        assert not free or (around.left(), around.center().y()) == (x, pytest.approx(y, abs=1))


def test_a_key_writes_at_cursor_a_and_other_shots_stay_without(panels, session, qtbot):
    stack = panels.shot.stack
    stack.show_cursors(True)
    stack.cursors.place(2.0, 5.0)
    panels.presenter.note_on_plot()
    qtbot.keyClicks(_editor(stack), "first contact")
    panels.tabs.setFocus()  # a click elsewhere keeps it, as in a table
    (note,) = session.entry(1).plot_notes
    zero, _ = time_zero(session.entry(1).shot)
    assert note.plot == "velocity" and note.x == pytest.approx(2e-3 + zero)
    motion = session.entry(1).shot.motion
    nearest = motion.velocity_m_per_s[np.argmin(np.abs(motion.time_s - note.x))]
    assert note.y == pytest.approx(nearest)  # on the curve
    panels.in_front = 2
    panels.shot.show_shot(session.entry(2).shot)
    panels.presenter.refresh()
    assert notes_drawn(stack.notes) == [] and session.entry(2).plot_notes == ()


def test_a_page_without_a_shot_says_where_notes_are_written(panels):
    panels.tabs.setCurrentIndex(Layout.LIVE)
    panels.presenter.note_on_plot()
    assert "SHOT" in panels.work.notices.words


def test_notes_are_kept_in_the_session_and_change_no_recording(session, tmp_path):
    session.change_plot_note(1, None, BOUNCE)
    session.change_plot_note(1, None, replace(BOUNCE, plot="spectrum", x=1.6e6, y=-80.0, text="µ-line"))
    session.change_plot_note(1, BOUNCE, replace(BOUNCE, text="fine after all"))
    again = Session.reopen(session.path)
    assert again.problem is None
    assert [note.text for note in again.entry(1).plot_notes] == ["fine after all", "µ-line"]
    assert again.entry(1).plot_notes == session.entry(1).plot_notes


def test_every_change_of_a_note_is_undone_and_done_again(session):
    edited = replace(BOUNCE, text="third bounce")
    steps = ((None, BOUNCE), (BOUNCE, edited), (edited, None))
    states = [session.entry(1).plot_notes]
    for before, after in steps:
        session.change_plot_note(1, before, after)
        states.append(session.entry(1).plot_notes)
    assert states == [(), (BOUNCE,), (edited,), ()]
    for state in states[-2::-1]:
        assert session.undo() is not None and session.entry(1).plot_notes == state
    for state in states[1:]:
        assert session.redo() is not None and session.entry(1).plot_notes == state
    session.change_plot_note(1, BOUNCE, None)  # not there any more: nothing to undo
    assert session.undo() == "the note on a plot of shot 1" and session.entry(1).plot_notes == (edited,)


def test_a_copy_that_is_analysed_again_has_the_notes_of_its_shot(session):
    session.change_plot_note(1, None, BOUNCE)
    copy = session.add(session.entry(1).shot, copy_of=1)
    assert copy.plot_notes == (BOUNCE,)


def test_a_note_of_a_later_version_is_left_out_and_said(session):
    session.change_plot_note(1, None, BOUNCE)
    text = session.path.read_text().replace('"plot": "force"', '"plot": "temperature"')
    session.path.write_text(text)
    again = Session.reopen(session.path)
    assert len(again.entries) == 2 and again.entry(1).plot_notes == ()
    assert "temperature" in again.problem


def test_a_note_keeps_its_place_when_the_residual_counts_in_another_unit(panels, session):
    session.change_plot_note(1, None, PlotNote("residual of displacement", 0.012, 3e-10, "here"))
    panels.presenter.refresh()
    motion, notes = panels.shot.motion, panels.shot.stack.notes
    motion.kind.setCurrentIndex(0)
    assert notes_drawn(notes) == []  # the residual of force is another plot
    motion.kind.setCurrentIndex(2)
    ((_, _, y),) = notes_drawn(notes)
    per_unit = {"m": 1.0, "mm": 1e3, "µm": 1e6, "nm": 1e9, "pm": 1e12}[motion.residual.unit]
    assert y == pytest.approx(3e-10 * per_unit)


@pytest.mark.parametrize("dot", [(0.2, 0.2), (0.8, 0.2), (0.2, 0.8), (0.8, 0.8)])
def test_a_note_is_taken_hold_of_at_its_dot_or_its_text_and_nowhere_else(panels, session, dot):
    stack, force = panels.shot.stack, panels.shot.motion.force
    (left, right), (bottom, top) = force.view.viewRange()
    x, y = left + dot[0] * (right - left), bottom + dot[1] * (top - bottom)
    zero, _ = time_zero(session.entry(1).shot)
    session.change_plot_note(1, None, PlotNote("force", 1e-3 * x + zero, y, "here"))
    panels.presenter.refresh()
    (drawn,) = stack.notes._drawn
    at, words = stack.mapToScene(_pixels(stack, force, x, y)), drawn._text.mapRectToScene(drawn._text.boundingRect())
    assert stack.notes.note_at(at) is stack.notes.note_at(words.center()) is drawn.note
    for aside in (QPointF(200.0, 0.0), QPointF(-200.0, 0.0), QPointF(0.0, 60.0), QPointF(0.0, -60.0)):
        assert stack.notes.note_at(at + aside) is None


def test_a_note_is_text_and_no_markup(panels, session):
    session.change_plot_note(1, None, replace(BOUNCE, text='v < 0 <img src="/etc/passwd">'))
    panels.presenter.refresh()
    (drawn,) = panels.shot.stack.notes._drawn
    assert drawn._text.toPlainText() == drawn.note.text
    assert "<img" not in drawn._dot.toolTip() and "&lt;img" in drawn._dot.toolTip()


def test_every_plot_of_a_shot_takes_notes(panels):
    """The names that plots give themselves are those that the session can read again."""
    shot, named = panels.shot, set()

    def look():
        for plot in shot.plots:
            named.update(axes.plot for axes in plot.notes._axes.values())

    for kind in range(3):
        shot.motion.kind.setCurrentIndex(kind)
        look()
    for view in ("deflection", "gap"):
        shot.set_view(view)
        look()
    driven = synthetic.driven_shot()
    shot.show_shot(driven)
    shot.show_drive(driven, drive_curves(driven.motion, driven.fit))
    look()
    assert named == set(PLOT_UNITS) - {"PD0", "PD1", "light switch", "spectrum", "spectrogram"}


def test_a_note_on_a_raw_signal_stands_where_the_recording_has_it(panels, session, qtbot):
    """Time counts from first touch on the plot and from the recording's first sample in the note."""
    recording = make_recording(free_flight(-0.2), 5000, order=(Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    shot = session.entry(1).shot
    panels.shot.show_shot(shot, recording)
    panels.shot.set_view("raw")
    assert panels.shot.raw.wanted is recording
    panels.shot.show_raw(curves_of(recording))
    names = ("PD0", "PD1", "light switch")
    for name in names:
        session.change_plot_note(1, None, PlotNote(name, 1e-4, 0.1, name))
    panels.presenter.refresh()
    zero, _ = time_zero(shot)
    drawn = {text: (x, y) for text, x, y in notes_drawn(panels.shot.raw.stack.notes)}
    assert drawn == dict.fromkeys(names, (pytest.approx(1e3 * (1e-4 - zero)), pytest.approx(0.1)))


def test_a_note_is_in_the_saved_picture_the_drawing_and_the_report(panels, session, tmp_path, qtbot):
    stack = panels.shot.stack

    def saved(name):
        save_png(stack, tmp_path / f"{name}.png")
        save_svg(stack, tmp_path / f"{name}.svg")
        return QImage(str(tmp_path / f"{name}.png")), (tmp_path / f"{name}.svg").read_text()

    bare, _ = saved("bare")
    zero, _ = time_zero(session.entry(1).shot)
    session.change_plot_note(1, None, replace(BOUNCE, x=zero + 1e-3, y=0.3))
    panels.presenter.refresh()
    qtbot.wait(50)
    noted, drawing = saved("noted")
    assert noted != bare and BOUNCE.text in drawing

    entry = session.entry(1)
    html = report_of([replace(entry.shot, plot_notes=entry.plot_notes)])
    assert html.count("remark-dot") == 1 + 2  # the style sheet's; force over the whole shot and at first contact
    assert html.count(BOUNCE.text) == 2 + 1  # and in the table
    assert "remark-dot" not in "".join(report_of([entry.shot]).partition("</head>")[2])
