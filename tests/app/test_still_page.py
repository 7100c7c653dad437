"""A page where nothing moves costs little: it is looked at seldom, and no live curve is made while nobody sees it."""

import json

import pytest

from app.window.main_window import LIVE_MS, PULL_MS, STILL_MS, open_window
from app.window.panels.layout import Layout
from tests.app import rigs

WAIT_MS = 60_000


@pytest.fixture
def window(qtbot, tmp_path, warm_kernels):
    (tmp_path / "settings.json").write_text(json.dumps({"levimass_settings": 1, "folder": str(tmp_path / "data")}))
    window = open_window(tmp_path, rigs.still_bench, apart=False)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: len(window.rig.latest().live.time_s) > 0, timeout=WAIT_MS)
    yield window
    if not window.close():
        window.close()


def _moves(window, qtbot, wait_ms=300) -> bool:
    """Return whether new live curves are made; the samples themselves go on in any case."""
    before = window.rig.latest()
    qtbot.waitUntil(lambda: window.rig.latest().signal.samples_read > before.signal.samples_read, timeout=WAIT_MS)
    qtbot.wait(wait_ms)
    return window.rig.latest().live is not before.live


def test_live_curves_are_made_while_they_are_looked_at(window, qtbot):
    qtbot.waitUntil(lambda: window._timer.interval() == LIVE_MS, timeout=WAIT_MS)
    assert _moves(window, qtbot)
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    qtbot.waitUntil(lambda: window._timer.interval() == STILL_MS, timeout=WAIT_MS)
    qtbot.wait(300)  # the look that was under way
    assert not _moves(window, qtbot)
    window.setup_presenter.toggle_setup()  # which shows the floor of the site
    qtbot.waitUntil(lambda: window._timer.interval() == LIVE_MS, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: _moves(window, qtbot), timeout=WAIT_MS)
    window.setup_presenter.toggle_setup()
    window.panels.tabs.setCurrentIndex(Layout.LIVE)
    qtbot.waitUntil(lambda: window._timer.interval() == LIVE_MS, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: _moves(window, qtbot), timeout=WAIT_MS)
    shown = window.panels.live._curves["velocity"].samples
    assert len(shown) > 10  # and they are drawn


def test_a_rig_that_is_armed_is_looked_at_often_on_any_page(window, qtbot):
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    qtbot.waitUntil(lambda: window._timer.interval() == STILL_MS, timeout=WAIT_MS)
    window.rig_presenter.arm()
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    qtbot.waitUntil(lambda: window._timer.interval() == PULL_MS, timeout=WAIT_MS)
