"""How the window is opened: where its files are, which source and site, its first messages, and its end."""

import json
import signal
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QSize
from PySide6.QtGui import QCloseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.session.log import ProgramLog
from app.window import main_window
from app.window.main_window import open_window
from app.window.panels.layout import Layout, restore_state, state_text
from app.window.presenters.view import HelpPresenter
from instrument.bench.site import USUAL_SITE
from tests.app import rigs

LONGEST_MS = 180_000


@pytest.fixture
def opened(qtbot, warm_kernels):
    windows = []

    def make(folder, *given, **how):
        windows.append(open_window(folder, *given, apart=False, **how))
        return windows[-1]

    yield make
    for window in windows:
        for _ in range(2):
            window.close()
        window.deleteLater()


def test_the_simulated_bench_stands_where_it_is_told_else_as_in_the_settings(opened, qtbot, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(
        main_window, "open_in_subprocess", lambda source: asked.append(source) or rigs.idle_bench(source)
    )
    for number, (site, chosen) in enumerate((("VC-A", None), (None, None), (None, "quiet"))):
        folder = tmp_path / str(number)
        folder.mkdir()
        values = {"levimass_settings": 1, "folder": str(folder / "data")} | ({"site": chosen} if chosen else {})
        (folder / "settings.json").write_text(json.dumps(values))
        window = opened(folder, site=site)
        qtbot.waitUntil(lambda number=number: len(asked) == number + 1, timeout=LONGEST_MS)
        qtbot.waitUntil(lambda window=window: window.rig.opened is not None, timeout=LONGEST_MS)
    assert asked == ["bench?site=VC-A", f"bench?site={USUAL_SITE}", "bench?site=quiet"]


def test_a_window_says_what_is_wrong_with_its_files_and_keeps_all_it_has_in_its_folder(opened, qtbot, tmp_path):
    (tmp_path / "settings.json").write_text("{")
    (tmp_path / "session.json").write_text("{")
    window = opened(tmp_path, rigs.idle_bench)
    said = [notice.words for _, notice in window.panels.work.notices.history]
    assert said[0].startswith("the last session could not be read") and said[1].startswith(
        "The settings in settings.json"
    )
    assert sys.getswitchinterval() == pytest.approx(5e-4)
    assert window.workbench.own_laws.folder == tmp_path / "laws" and window.log.folder == tmp_path
    assert window.workbench.session.path == tmp_path / "session.json" and window.theme.parent() is window
    assert window._timer.isActive() and window._timer.interval() in (35, 100, 140)
    window.resize(1111, 600)
    window.panels.across.setSizes([700, 400])
    kept = state_text(window, window.panels)
    sizes = window.panels.across.sizes()
    window.resize(1000, 640)
    window.panels.across.setSizes([500, 500])
    restore_state(window, window.panels, "not a state")
    assert window.size() == QSize(1000, 640)
    restore_state(window, window.panels, kept)
    assert window.panels.across.sizes()[0] - window.panels.across.sizes()[1] == pytest.approx(
        sizes[0] - sizes[1], abs=60
    )


def test_closing_asks_once_where_something_is_at_stake_and_saves_the_window(opened, qtbot, tmp_path, monkeypatch):
    window = opened(tmp_path, rigs.idle_bench)
    at_stake = {"a": "1 shot is only in memory", "b": "1 shot is only in memory", "rig": "The rig is armed"}
    monkeypatch.setattr(window, "_unsaved_items", lambda _: at_stake)
    closed = []
    monkeypatch.setattr(window.workbench, "close", lambda close=window.workbench.close: closed.append(1) or close())
    event = QCloseEvent()
    window.closeEvent(event)
    assert not event.isAccepted() and not closed
    newest = window.panels.work.notices.words
    assert newest == "1 shot is only in memory; The rig is armed. Close again to quit anyway"
    at_stake.pop("rig")
    window.pull()  # the rig no longer is: it would be said anew
    at_stake["rig"] = "The rig is armed"
    window.closeEvent(event := QCloseEvent())
    assert not event.isAccepted()
    window.closeEvent(event := QCloseEvent())
    assert event.isAccepted() and closed == [1] and not window._timer.isActive()
    assert json.loads((tmp_path / "settings.json").read_text())["window"] == state_text(window, window.panels)


def test_the_program_runs_with_its_log_a_tour_and_ctrl_c(qapp, tmp_path, monkeypatch, warm_kernels):
    made, ended = [], []
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(main_window, "user_config_path", lambda name: tmp_path / name)
    monkeypatch.setattr(main_window, "user_log_path", lambda name: tmp_path / "log" / name)

    def opens(folder, *, site, log):
        made.append((folder, site, log.folder, open_window(folder, rigs.idle_bench, apart=False, site=site, log=log)))
        return made[-1][-1]

    monkeypatch.setattr(main_window, "open_window", opens)
    monkeypatch.setattr(QApplication, "exec", lambda *_: 5)
    monkeypatch.setattr(ProgramLog, "close", lambda log, close=ProgramLog.close: ended.append(log) or close(log))
    started = []
    monkeypatch.setattr(HelpPresenter, "start_once", lambda presenter: started.append(1))
    name, styles = qapp.applicationName(), []
    monkeypatch.setattr(QApplication, "setStyle", lambda *given: styles.append(given[-1]))
    try:
        assert main_window.run([], "VC-B") == 5
        ((folder, site, log_folder, window),) = made
        assert (folder, site, log_folder) == (tmp_path / "levimass", "VC-B", tmp_path / "log" / "levimass")
        assert window.isVisible() and started == [1] and len(ended) == 1 and window.log is ended[0]
        assert qapp.applicationName() == "Levimass" and styles == ["Fusion"]
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
        assert (tmp_path / "log" / "levimass" / "levimass.log").exists()
    finally:
        signal.signal(signal.SIGINT, before)
        qapp.setApplicationName(name)
        for *_, window in made:
            for _ in range(2):
                window.close()


def test_the_tour_starts_by_itself_the_first_time_alone(opened, tmp_path):
    window = opened(tmp_path, rigs.idle_bench)
    window.show()
    window.help_presenter.start_once()
    assert window.panels.tour.isVisible()
    window.panels.tour.toggle()
    assert not window.panels.tour.isVisible() and window._store.settings.tour_done
    window.help_presenter.start_once()
    assert not window.panels.tour.isVisible()
    window.panels.tour.toggle()
    assert window.panels.tour.isVisible() and window.panels.tour.title.text() == "Press ARM"
    window.panels.tour.close()
    QTest.qWait(1)
    assert Path(tmp_path / "settings.json").exists() and window.panels.tabs.currentIndex() == Layout.LIVE
