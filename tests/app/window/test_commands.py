"""What each command of the menus does, against what is written down in ``screen/``."""

from dataclasses import replace
from pathlib import Path

from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu

from app.window.controls.commands import COMMANDS
from app.window.panels.layout import Layout
from app.window.panels.session_model import NOTE
from app.window.plots.plot_notes import NoteEditor
from tests.app import synthetic
from tests.app.on_screen import effect_button
from tests.app.window import shown
from tests.app.window.scene import DRAG, FIRST, SECOND, check, found_by, quiet, settle, show

SHEETS = ("settings", "setup", "mapping", "law", "keys", "about", "messages", "tour")


def _state(window) -> list[str]:
    """Return page, view, sheets, focus, plot in front and clipboard."""
    p = window.panels
    plot = p.plot_in_front()
    focus = window.focusWidget()
    lines = [f"page {Layout.PAGES[p.tabs.currentIndex()]}, view {p.shot.view}, shots {p.table.numbers}"]
    lines += [f"sheet {name}" for name in SHEETS if getattr(p, name).isVisible()]
    lines += [f"focus {focus.accessibleName() or type(focus).__name__}"] if focus is not None else []
    if plot is not None:
        named = f"plot {plot.name!r} from {shown._span(*plot.span)}"
        lines.append(named + (f", cursors at {shown._span(*plot.cursors.places)}" if plot.cursors.shown else ""))
    clip = QGuiApplication.clipboard()
    words = "a picture" if not clip.image().isNull() else repr(clip.text()[:70])
    boxes = {"hold": p.live.hold, "noise only": p.numbers.noise_only, "re-arm": p.controls.rearm}
    lines += [f"clipboard {words}", f"checked {[name for name, box in boxes.items() if box.isChecked()]}"]
    return lines


def _dialogs(window) -> list[str]:
    """Return what each file dialog asks for, answer it with a path, and close it."""
    lines = []
    for dialog in window.findChildren(QFileDialog):
        if dialog.isVisible():
            asks = dialog.acceptMode().name, dialog.fileMode().name, dialog.nameFilters(), dialog.defaultSuffix()
            named = [Path(path).name for path in dialog.selectedFiles()] if dialog.defaultSuffix() else []
            lines.append(
                f"dialog {dialog.windowTitle()!r}: {' '.join(map(str, asks))} {named}, modal {dialog.isModal()}"
            )
            dialog.filesSelected.emit(["/there/chosen"])
            dialog.close()
    return lines


def _menus() -> list[str]:
    lines = []
    for widget in QApplication.topLevelWidgets():
        if isinstance(widget, QMenu) and widget.isVisible():
            lines += shown.of_menu(widget)
            widget.close()
    return lines


def _start(window):
    """Bring the window to where each command begins: SHOT with its first shot, no sheet, no message."""
    for name in SHEETS:
        getattr(window.panels, name).hide()
    session = window.workbench.session
    while session.entry(FIRST) is None and session.undo():
        pass
    panels = show(window, Layout.SHOT, FIRST)
    for box in (panels.live.hold, panels.numbers.noise_only, panels.controls.rearm):
        box.setChecked(False)
    for plot in (*panels.shot.plots, *panels.compare.findChildren(type(panels.compare.stack))):
        plot.show_cursors(False)
    window.view_presenter.show_view("whole")
    for editor in window.findChildren(NoteEditor):
        editor.left.emit()
    panels.table.table.setFocus()
    QGuiApplication.clipboard().clear()
    while panels.work.notices.words:
        panels.work.notices.next()
    settle(window)


def test_each_command_does_what_its_words_say(window, calls, monkeypatch):
    monkeypatch.setattr(window.setup_presenter, "_find", lambda: ())
    parts = {}
    for command in COMMANDS:
        if command.action in ("recent", "close", "show_manual"):
            continue
        _start(window)
        before = _state(window)
        calls.clear()
        window.actions_by_name[command.action].trigger()
        QTest.qWait(2)
        dialogs, menus = _dialogs(window), _menus()
        QTest.qWait(2)
        after = _state(window)
        editors = [f"writing {e.accessibleName()}" for e in window.findChildren(NoteEditor) if e.isVisible()]
        said = [f"said: {window.panels.work.notices.words}"] if window.panels.work.notices.words else []
        said = [line.replace(str(window.log.folder), "FOLDER") for line in said]
        lines = [*calls, *dialogs, *menus, *editors, *said, *(line for line in after if line not in before)]
        parts[command.words] = [line.replace(str(window.log.folder.name), "FOLDER") for line in lines]
    _start(window)
    check("commands", parts)


def test_commands_on_the_other_pages(window, calls):
    """The same keys on COMPARE, on LIVE, and where there is no plot."""
    parts = {}
    for page in (Layout.LIVE, Layout.COMPARE, Layout.SPECTRUM, Layout.BUDGET):
        for name in (
            "show_view:contact",
            "on_plot:toggle_cursors",
            "on_plot:reset",
            "step_view:-1",
            "note_on_plot",
            "on_plot:open_menu",
        ):
            _start(window)
            show(window, page, *((FIRST,) if page == Layout.SPECTRUM else (FIRST, SECOND)))
            before = _state(window)
            window.actions_by_name[name].trigger()
            QTest.qWait(2)
            menus = _menus()
            said = [f"said: {window.panels.work.notices.words}"] if window.panels.work.notices.words else []
            changed = [line for line in _state(window) if line not in before]
            parts[f"{Layout.PAGES[page]}: {name}"] = [*menus[:1], *said, *changed]
    _start(window)
    check("commands-elsewhere", parts)


def test_notes_removals_and_steps_through_the_list(window):
    """Ctrl+Up and Down step through the list; what was removed comes back; a note is undone and done again."""
    _start(window)
    panels, press = window.panels, window.actions_by_name

    def after(*names):
        for name in names:
            press[name].trigger()
        settle(window)
        notes = [entry.note for entry in window.workbench.session.entries]
        return panels.table.numbers, panels.table.shown, notes, panels.work.notices.words

    assert after("step_shot:1")[0] == [2] and after("step_shot:-1", "step_shot:-1")[0] == [1]
    panels.table.select([])
    assert after("step_shot:-1")[0] == [4]  # the last where none is selected
    assert after("step_shot:1")[0] == [4]
    panels.table.select([2, 3])
    settle(window)
    removed = after("remove_selected")
    assert removed[1:] == ([1, 4], ["", ""], "2 shots removed from the list; Undo (Ctrl+Z) restores them")
    assert after("undo")[1:] == ([1, 2, 3, 4], ["", "pushed by hand", "", ""], "Undone: the removal")
    assert after("redo")[1:] == ([1, 4], ["", ""], "Redone: the removal")
    assert after("undo", "undo")[2:] == (["", "", "", ""], "Undone: the note of shot 2")
    assert after("undo")[3] == "Nothing to undo"
    assert after("redo")[2:] == (["", "pushed by hand", "", ""], "Redone: the note of shot 2")
    panels.table.model.setData(panels.table.model.index(0, NOTE), "by hand")
    settle(window)
    assert window.workbench.session.entry(FIRST).note == "by hand"
    assert after("redo")[3] == "Nothing to redo"


def test_effects_are_added_removed_and_tried_by_the_buttons_of_a_diagnosis(window, calls):
    show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    page = window.panels.diagnosis
    window.workbench._take_diagnosis(
        (FIRST, SECOND), found_by([window.workbench.session.entry(n).shot for n in (1, 2)])
    )
    settle(window)
    effect_button(page.effects, DRAG.key).click()
    page.diagnose.click()
    window.panels.model.diagnose.click()
    assert calls == [
        "workbench.model.add(paper, [quadratic drag on the block])",
        "workbench.diagnose([1, 2])",
        "workbench.diagnose([1, 2])",
    ]


def test_a_diagnosis_made_again_and_a_copy_of_a_shot_are_shown_like_the_first(window):
    """They are equal but for their arrays, which have no order: whatever is compared is compared as an object."""
    copied = replace(synthetic.shot("run-1", 0.265, 1), path=window.workbench.session.entry(FIRST).path)
    copy = window.workbench.session.add(copied, copy_of=FIRST)
    panels = show(window, Layout.COMPARE, FIRST)
    show(window, Layout.COMPARE, copy.number)
    (drawn,) = panels.compare.stack.shows
    assert (
        drawn is window.workbench.session.entry(copy.number).shot
        and panels.compare.stack.accessibleDescription() == "Shot 5"
    )
    for _ in range(2):
        shots = [synthetic.shot("run-1", 0.265, 1), window.workbench.session.entry(SECOND).shot]
        window.workbench._take_diagnosis((FIRST, SECOND), found_by(shots))
        panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    settle(window)
    assert panels.diagnosis._diagnosis is window.workbench.diagnoses.newest.diagnosis
    assert panels.diagnosis.next_shot.isVisible() and panels.model.verdict.text() == "! quadratic drag on the block"


def test_the_rig_is_armed_aborted_and_opened_by_its_buttons(window, calls, monkeypatch):
    panels = window.panels
    panels.controls.arm.click()
    assert panels.tabs.currentIndex() == Layout.LIVE
    window.rig_presenter.use_source("scpi:10.0.0.7")
    window.rig_presenter.use_source(window.rig.source)  # is open already
    panels.controls.rearm.setChecked(True)
    panels.controls.rearm.setChecked(False)
    assert calls == ["rig.arm()", "rig.open(scpi:10.0.0.7)", "rig.set_rearm(True)", "rig.set_rearm(False)"]
    assert window._store.settings.source == "scpi:10.0.0.7"
    window._store.remember_source("bench")
    calls.clear()
    panels.keys.show()
    window.rig_presenter.abort()  # closes the sheet first
    assert not panels.keys.isVisible() and calls == []
    window.rig_presenter.abort()
    assert calls == ["rig.abort()"]
    monkeypatch.setattr(window.rig, "latest", lambda: quiet(unsaved=("run-1",)))
    window.rig_presenter.save_elsewhere()
    assert "Save the shots in memory to" in _dialogs(window)[0]
    assert calls[1:] == ["workbench.unsaved.save(save_pending, /there/chosen)"]
