"""What an operator did or took is kept: typed numbers, notes, unanalysed shots, the keyboard's place."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QLocale
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from analysis.fitted.fitted_shot import fit_pending
from analysis.pipeline import fitted, read
from analysis.shot.motion import ARRAYS
from analysis.shot.recording import Channel, Recording, Role, Setup
from analysis.shot.shot import AnalysisSettings, Cancelled, Shot
from app.session.log import NAME, ProgramLog, note
from app.session.result_cache import ResultCache
from app.session.rig import Rig
from app.session.session import Entry, Session
from app.session.session_files import Unlisted, listed_by, unlisted
from app.session.settings import Settings
from app.session.settings_store import SettingsStore
from app.session.workbench import Workbench
from app.window.controls.theme import Theme
from app.window.controls.widgets import Sheet
from app.window.panels.layout import Layout
from app.window.panels.session_model import VERDICT
from app.window.panels.settings_sheet import SettingsSheet
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter
from app.words.wording import DASH, localised_number, typed_number
from instrument.bench.simulated_shots import simulate
from instrument.capture.analysis_thread import AnalysisThread, ShotAnalysis
from instrument.capture.snapshot import CapturedShot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings, Digitizer, DigitizerError
from instrument.files.recording_file import open_recording
from instrument.files.recording_writer import RecordingWriter, write_recording
from tests.app import synthetic

WAIT_MS = 30_000
CHANNELS = (Channel(Role.MEASUREMENT, 1e-3),)


def _sheet(qtbot: QtBot) -> tuple[SettingsSheet, list[dict[str, object]]]:
    """Return the settings as they come, and the list into which it lays what is applied."""
    sheet = SettingsSheet()
    qtbot.addWidget(sheet)
    sheet.show_values(Settings().values())
    taken: list[dict[str, object]] = []
    sheet.applied.connect(taken.append)
    return sheet, taken


@pytest.mark.parametrize("locale", ["de_DE", "en_US", "fr_FR", "C"])
@pytest.mark.parametrize("typed", ["17.85", "17,85"])
def test_a_typed_mass_is_the_same_in_every_country(qtbot: QtBot, locale: str, typed: str) -> None:
    before = QLocale()
    QLocale.setDefault(QLocale(locale))
    try:
        sheet, taken = _sheet(qtbot)
        editor = sheet._editors["moving_mass_kg"]
        assert isinstance(editor, QLineEdit)
        editor.clear()
        qtbot.keyClicks(editor, typed)
        sheet.apply()
        assert taken and taken[0]["moving_mass_kg"] == pytest.approx(17.85e-3, rel=1e-12)
    finally:
        QLocale.setDefault(before)


@pytest.mark.parametrize("typed", ["20.5 100", "20,5; 100", "20.5, 100", "  20,5   100 ;"])
def test_weights_are_typed_as_a_list_in_grams_and_come_back(qtbot: QtBot, typed: str) -> None:
    sheet, taken = _sheet(qtbot)
    sheet._editors["weights_kg"].setText(typed)
    sheet.apply()
    assert taken and taken[0]["weights_kg"] == "0.0205 0.1" and taken[0]["speeds_m_per_s"] == "0.05 0.1 0.2 0.35 0.6"
    sheet.show_values(Settings().values() | {"weights_kg": "0.0205 0.1"})
    shown = sheet._editors["weights_kg"]
    assert isinstance(shown, QLineEdit) and shown.text() == f"{localised_number('20.5')}  100"
    for wrong, words in (("20,5,100", "ambiguous"), ("heavy", "not a number"), ("0.01", "outside")):
        sheet._editors["weights_kg"].setText(wrong)
        sheet.apply()
        assert words in sheet.problem.text() and len(taken) == 1
    sheet._editors["weights_kg"].setText("")
    sheet.apply()
    assert taken[-1]["weights_kg"] == ""


@pytest.mark.parametrize("typed", ["1.785,3", "1,785.3", "1.785.3", "1_785", "nan", "inf", "", "17.85 g"])
def test_what_may_mean_two_things_is_refused(typed: str) -> None:
    with pytest.raises(ValueError, match=r"ambiguous|not a number"):
        typed_number(typed)


def test_a_sheet_forgets_a_button_that_was_deleted(qtbot: QtBot) -> None:
    main = QWidget()
    qtbot.addWidget(main)
    button, field = QPushButton("Add", main), QLineEdit()
    sheet = Sheet("sheet", main)
    field.setParent(sheet)
    main.show()
    main.activateWindow()
    qtbot.waitUntil(main.isActiveWindow, timeout=WAIT_MS)
    button.setFocus()
    sheet.open_at(field)
    button.deleteLater()
    QApplication.sendPostedEvents(None, 0)
    QApplication.processEvents()
    sheet.hide()
    assert sheet.isHidden()


def _recording(folder: Path, name: str = "shot-0001") -> Path:
    folder.mkdir(exist_ok=True)
    counts = np.zeros((64, 1), np.int16)
    return write_recording(Recording(name, counts, 1e6, CHANNELS, Setup(17.85e-3)), folder / name)


def _stopped(meta: Path) -> CapturedShot:
    return CapturedShot(1, "shot-0001", meta, CaptureSettings(1e6, 64, 0), problem="stopped")


def test_a_note_reaches_the_recording(qtbot: QtBot, tmp_path: Path) -> None:
    meta = _recording(tmp_path)
    workbench = Workbench(Session(), AnalysisSettings)
    try:
        entry = workbench.add_unanalysed(_stopped(meta))
        workbench.set_note(entry.number, "the block wobbled")
        qtbot.waitUntil(lambda: open_recording(meta).note == "the block wobbled", timeout=WAIT_MS)
        assert workbench.poll() == []
    finally:
        workbench.close()


def test_a_note_does_not_wait_for_long_work(qtbot: QtBot, tmp_path: Path) -> None:
    """Behind a diagnosis or the compiling of a first start it would be lost where the window closes meanwhile."""
    meta, workbench, ended = _recording(tmp_path), Workbench(Session(), AnalysisSettings), threading.Event()
    try:
        workbench.jobs.submit("a long diagnosis", lambda _, __: ended.wait(10 * WAIT_MS / 1e3), "diagnosis")
        entry = workbench.add_unanalysed(_stopped(meta))
        workbench.set_note(entry.number, "the block wobbled")
        qtbot.waitUntil(lambda: open_recording(meta).note == "the block wobbled", timeout=WAIT_MS)
    finally:
        ended.set()
        workbench.close()


@pytest.fixture
def away(qtbot: QtBot, tmp_path: Path) -> Iterator[tuple[Workbench, Layout, SessionPresenter]]:
    """A workbench with its panels and no rig."""
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    workbench = Workbench(Session(tmp_path / "session.json"), AnalysisSettings)
    selection = SelectionPresenter(workbench, panels, panels)
    yield (
        workbench,
        panels,
        SessionPresenter(workbench, SettingsStore(tmp_path / "settings.json"), panels, selection, panels),
    )
    workbench.close()


Away = tuple[Workbench, Layout, SessionPresenter]


def test_a_shot_whose_analysis_was_stopped_is_listed_and_analysed_in_its_place(
    qtbot: QtBot, tmp_path: Path, away: Away
) -> None:
    workbench, _, presenter = away
    meta = _recording(tmp_path)
    stopped = CapturedShot(1, "shot-0001", meta, CaptureSettings(1e6, 64, 0), None, "the analysis was stopped")
    presenter.take(stopped, stay=False)
    (entry,) = workbench.session.entries
    assert entry.path == str(meta) and entry.shot is not None and "Ctrl+R" in (entry.shot.problem or "")
    assert Session.reopen(tmp_path / "session.json").entries[0].path == str(meta)
    before = entry.shot
    presenter.reanalyse_selected()
    qtbot.waitUntil(lambda: bool(workbench.poll()), timeout=WAIT_MS)
    (entry,) = workbench.session.entries
    assert entry.shot is not before


@pytest.fixture(scope="module")
def read_shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    """Return a shot of the bench as the rig tells it first: read, and awaiting its fit."""
    (path,) = simulate(tmp_path_factory.mktemp("shots"), 1)
    shot = read(open_recording(path))
    assert fit_pending(shot)
    return shot


def _as_from_another_process(shot: Shot) -> Shot:
    assert shot.motion is not None
    arrays = {name: getattr(shot.motion, name).copy() for name in ARRAYS}
    return replace(shot, motion=replace(shot.motion, **arrays))


def _finished(shot: Shot, fitted_later: bool = False) -> CapturedShot:
    settings = CaptureSettings(1e6, 64, 0)
    return CapturedShot(1, shot.name, Path(shot.path or ""), settings, shot, fitted_later=fitted_later)


def test_a_shot_whose_fit_is_to_follow_is_listed_at_once_and_takes_it_in_its_place(away: Away, read_shot: Shot) -> None:
    workbench, panels, presenter = away
    presenter.take(_finished(read_shot), stay=False)
    (entry,) = workbench.session.entries
    model = panels.table.model
    cells = [model.data(model.index(0, column)) for column in range(model.columnCount())]
    assert any("fit to follow" in str(cell) or "+" in str(cell) for cell in cells)  # the flags
    assert cells[8] == DASH and DASH not in cells[3:8]  # the stiffness is the fit's; all else is there
    assert "fit to follow" in panels.model._model.text()
    workbench.session.set_note(entry.number, "written meanwhile")
    whole = fitted(_as_from_another_process(read_shot))
    presenter.take(_finished(whole, fitted_later=True), stay=False)
    (entry,) = workbench.session.entries
    assert entry.shot is not None and entry.shot.fit is whole.fit and entry.note == "written meanwhile"
    assert "χ²" in panels.model._fit.text()
    presenter.take(_finished(whole, fitted_later=True), stay=False)  # a straggler finds nobody who waits
    assert len(workbench.session.entries) == 1


def test_a_shot_whose_readings_and_fit_come_between_two_looks_of_the_screen_is_listed_with_both(
    away: Away, read_shot: Shot
) -> None:
    """The window may stand still for a moment, with a question open or a disk that is full."""
    workbench, _, presenter = away

    def nothing_opens(_: str) -> Digitizer:
        raise DigitizerError("no digitizer", "none is needed here")

    rig = Rig(lambda *_: CaptureOptions(Path()), AnalysisSettings, lambda *_: None, open_digitizer=nothing_opens)
    try:
        fit = _finished(fitted(read_shot), fitted_later=True)
        for captured in (replace(fit, shot=None, waits=True), fit, fit):
            for news in rig.take_shots(replace(rig.latest(), captured=(captured,))):
                presenter.take(news, stay=True)
    finally:
        rig.close()
    (entry,) = workbench.session.entries
    assert entry.shot is not None and entry.shot.fit is not None


def test_a_shot_its_fit_and_what_was_not_analysed_are_announced_once_each(
    tmp_path: Path, away: Away, read_shot: Shot
) -> None:
    """The banner and a planned shot that is waited for hear of it so."""
    workbench, _, presenter = away
    announced: list[Entry] = []
    presenter.arrived.connect(announced.append)
    presenter.take(_finished(read_shot), stay=True)
    assert [(entry.number, entry.shot is not None and entry.shot.fit is None) for entry in announced] == [(1, True)]
    whole = fitted(_as_from_another_process(read_shot))
    presenter.take(_finished(whole, fitted_later=True), stay=True)
    assert announced[1:] == [workbench.session.entry(1)] and announced[1].shot is not None
    assert announced[1].shot.fit is whole.fit
    presenter.take(_finished(whole, fitted_later=True), stay=True)  # it waits no longer
    assert len(announced) == 2
    stopped = CapturedShot(2, "b", _recording(tmp_path, "b"), CaptureSettings(1e6, 64, 0), None, "it was stopped")
    presenter.take(stopped, stay=True)
    assert [entry.name for entry in announced[2:]] == ["b"]


def test_killed_between_readings_and_fit_the_next_start_analyses_the_shot_whole(
    qtbot: QtBot, tmp_path: Path, away: Away, read_shot: Shot
) -> None:
    _, _, presenter = away
    presenter.take(_finished(read_shot), stay=False)
    # the end comes here: what the disk holds by now is all that the next start knows
    results = ResultCache(tmp_path / "kept")
    again = Workbench(Session.reopen(tmp_path / "session.json"), AnalysisSettings, results=results)
    try:
        (entry,) = again.session.entries
        assert entry.path == read_shot.path and entry.shot is None
        again.read_unread()
        qtbot.waitUntil(lambda: (again.poll(), again.session.entries[0].shot is not None)[1], timeout=WAIT_MS)
        shot = again.session.entries[0].shot
        assert shot is not None and shot.fit is not None and not fit_pending(shot)
    finally:
        again.close()


def test_a_shot_that_was_off_the_list_when_its_fit_came_is_fitted_once_it_is_back(
    qtbot: QtBot, away: Away, read_shot: Shot
) -> None:
    workbench, _, presenter = away
    presenter.take(_finished(read_shot), stay=False)
    workbench.session.remove([1])
    presenter.take(_finished(fitted(read_shot), fitted_later=True), stay=False)
    assert workbench.session.entries == ()
    workbench.undo()

    def fit_came() -> bool:
        presenter.refresh()
        shot = workbench.session.entries[0].shot
        return shot is not None and shot.fit is not None and not fit_pending(shot)

    qtbot.waitUntil(fit_came, timeout=WAIT_MS)


def test_a_fit_that_abort_stopped_is_made_beside_the_rig(qtbot: QtBot, away: Away, read_shot: Shot) -> None:
    """Esc while the next shot is analysed met the fit of the one before: it passed for one that failed."""
    workbench, _, presenter = away

    def interrupted(_: Shot, __: object, ___: object) -> Shot:
        raise Cancelled

    told: list[Shot | None] = []
    analyst = AnalysisThread(ShotAnalysis(lambda *_: read_shot, interrupted, 1), lambda _, shot, __: told.append(shot))
    analyst.start()
    analyst.submit(1, open_recording(Path(str(read_shot.path))))
    qtbot.waitUntil(lambda: len(told) == 2, timeout=WAIT_MS)
    assert analyst.close(60.0) and told[0] is not None and told[1] is not None
    presenter.take(_finished(told[0]), stay=False)
    presenter.take(_finished(told[1], fitted_later=True), stay=False)
    shot = workbench.session.entries[0].shot
    assert shot is not None and "fit_failed" not in shot.flags

    def fit_came() -> bool:
        presenter.refresh()
        shot = workbench.session.entries[0].shot
        return shot is not None and shot.fit is not None and not fit_pending(shot)

    qtbot.waitUntil(fit_came, timeout=WAIT_MS)


def test_a_recording_that_a_kill_cut_off_is_offered_at_the_next_start(qtbot: QtBot, tmp_path: Path, away: Away) -> None:
    workbench, panels, presenter = away
    whole = _recording(tmp_path)
    writer = RecordingWriter(tmp_path / "shot-0002", 1e6, CHANNELS, Setup(17.85e-3))
    writer.append(np.zeros((64, 1), np.int16))
    writer.release()  # as a kill leaves it: no hash
    cut = tmp_path / "shot-0002.sigmf-meta"
    later_s = time.time() + 1.0
    assert unlisted(tmp_path, (), later_s) == Unlisted((whole,), (cut,))
    assert unlisted(tmp_path, (str(cut), str(whole)), later_s) == Unlisted() == unlisted(tmp_path, (), 0.0)
    assert unlisted(tmp_path / "none", (), later_s) == Unlisted()
    whole.unlink()

    time.sleep(0.01)
    workbench.find_unlisted(tmp_path)
    notices = panels.work.notices
    qtbot.waitUntil(lambda: (presenter.refresh(), "shot-0002" in notices.words)[1], timeout=WAIT_MS)
    notices._do.click()
    qtbot.waitUntil(lambda: (presenter.refresh(), len(workbench.session.entries) == 1)[1], timeout=WAIT_MS)
    assert workbench.session.entries[0].path == str(cut) and notices.words == ""


def test_of_many_unlisted_recordings_three_are_named_and_the_rest_counted(away: Away) -> None:
    workbench, _, _ = away
    paths = tuple(Path(f"shot-{number:04d}.sigmf-meta") for number in range(1, 6))
    for count, words in ((3, "shot-0001, shot-0002, shot-0003"), (5, "shot-0001, shot-0002, shot-0003 and 2 more")):
        workbench._take_unlisted(Unlisted(paths[:count]))
        (event,) = workbench.poll()
        assert event.words == f"{count} recordings in the data folder are in no session: {words}"


def test_a_recording_that_no_session_lists_is_offered_until_it_is_declined(
    qtbot: QtBot, tmp_path: Path, away: Away
) -> None:
    """Killed while twelve shots waited for their analysis, the next start never mentioned them."""
    workbench, panels, presenter = away
    first, second = _recording(tmp_path), _recording(tmp_path / "of another session", "shot-0009")
    others = Session(tmp_path / "session-2.json")
    others.add_captured("shot-0009", str(second), AnalysisSettings())
    assert listed_by([tmp_path / "session-2.json", tmp_path / "none.json", first]) == {str(second)}
    notices = panels.work.notices
    time.sleep(0.01)
    for folder, found in ((second.parent, ""), (tmp_path, "shot-0001")):
        workbench.find_unlisted(folder, [tmp_path / "session-2.json"])
        qtbot.waitUntil(lambda: workbench.short_jobs.open_jobs == 0, timeout=WAIT_MS)
        presenter.refresh()
        assert found in notices.words and bool(notices.words) == bool(found)
    notices.next()  # declined
    again = Session.reopen(tmp_path / "session.json")
    assert again.dismissed == (str(first),)
    workbench.find_unlisted(tmp_path)
    qtbot.waitUntil(lambda: workbench.short_jobs.open_jobs == 0, timeout=WAIT_MS)
    presenter.refresh()
    assert not notices.words


def test_a_shot_is_listed_when_it_is_captured_and_survives_a_kill_before_its_analysis(
    qtbot: QtBot, tmp_path: Path, away: Away
) -> None:
    workbench, panels, presenter = away
    metas = [_recording(tmp_path, f"shot-000{number}") for number in (1, 2, 3)]
    settings = CaptureSettings(1e6, 64, 0)
    for number, meta in enumerate(metas, 1):
        waits = CapturedShot(number, meta.name.removesuffix(".sigmf-meta"), meta, settings, waits=True)
        presenter.take(waits, stay=True)
    assert [entry.path for entry in workbench.session.entries] == list(map(str, metas))
    model = panels.table.model
    assert str(model.data(model.index(1, VERDICT))) == "waiting for analysis"
    # killed here: what the disk holds is all that the next start knows
    assert [entry.path for entry in Session.reopen(tmp_path / "session.json").entries] == list(map(str, metas))

    workbench.set_note(2, "wobbled")
    shot = replace(synthetic.shot("shot-0002"), path=str(metas[1]))
    presenter.take(CapturedShot(2, "shot-0002", metas[1], settings, shot), stay=True)
    assert [entry.number for entry in workbench.session.entries] == [1, 2, 3]
    entry = workbench.session.entry(2)
    assert entry is not None and entry.shot is not None and entry.note == "wobbled"

    workbench.session.remove([3])  # it does not come back by itself, but by an undo, and is analysed then
    last = replace(synthetic.shot("shot-0003"), path=str(metas[2]))
    presenter.take(CapturedShot(3, "shot-0003", metas[2], settings, last), stay=True)
    assert [entry.number for entry in workbench.session.entries] == [1, 2]
    workbench.undo()

    def analysed() -> bool:
        presenter.refresh()
        entry = workbench.session.entry(3)
        return entry is not None and entry.shot is not None

    qtbot.waitUntil(analysed, timeout=WAIT_MS)


def test_a_shot_saved_elsewhere_before_its_analysis_keeps_its_place(tmp_path: Path, away: Away) -> None:
    workbench, _, presenter = away
    waits = CapturedShot(1, "shot-0001", None, CaptureSettings(1e6, 64, 0), waits=True)
    presenter.take(waits, stay=True)
    assert workbench.session.set_path("shot-0001", str(tmp_path / "a.sigmf-meta"))
    presenter.take(replace(waits, shot=synthetic.shot("shot-0001"), waits=False), stay=True)
    (entry,) = workbench.session.entries
    assert entry.path == str(tmp_path / "a.sigmf-meta") and entry.shot is not None and entry.shot.path == entry.path


def test_a_folder_of_shots_does_not_take_the_selection_and_a_picture_is_refused(
    qtbot: QtBot, tmp_path: Path, away: Away
) -> None:
    workbench, panels, presenter = away
    (tmp_path / "plot.png").write_bytes(b"\x89PNG")
    presenter.open_paths([tmp_path / "plot.png"])
    assert "plot.png is not a recording" in panels.work.notices.words and workbench.jobs.open_jobs == 0
    for n in range(3):
        write_recording(
            Recording(f"s-{n}", np.zeros((64, 1), np.int16), 1e6, CHANNELS, Setup(17.85e-3)), tmp_path / f"s-{n}"
        )
    presenter.open_paths([tmp_path])
    qtbot.waitUntil(lambda: (presenter.refresh(), len(workbench.session.entries) == 3)[1], timeout=WAIT_MS)
    assert panels.table.numbers == [1]


def test_an_exception_of_any_thread_reaches_the_log_and_the_screen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = ProgramLog(tmp_path / "log")
    log.install()
    try:

        def broken() -> None:
            raise ValueError("the plate\nis gone")

        thread = threading.Thread(target=broken)
        thread.start()
        thread.join()
        note("Report saved")
        (told,) = log.take_problems()
        assert "ValueError: the plate is gone" in told and log.take_problems() == []
    finally:
        log.close()
    written = (tmp_path / "log" / NAME).read_text(encoding="utf-8")
    assert "in broken" in written and "Report saved" in written
    assert "ValueError" in capsys.readouterr().err
