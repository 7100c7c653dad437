"""The real window on a rig at rest, with a session of four shots."""

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale
from PySide6.QtGui import QDesktopServices
from PySide6.QtTest import QTest

from analysis.shot.quantity import Quantity
from app.session.session import Session
from app.window.main_window import open_window
from instrument.bench.simulated_shots import simulate
from tests.app import rigs, synthetic
from tests.app.window.scene import LONGEST_S, SECOND, quiet, settle

RECORDED = {
    "rig": ("arm", "abort", "trigger_now", "set_rearm", "open"),
    "workbench": ("diagnose", "reanalyse", "open_paths", "open_session", "save_session", "open_unnamed_session"),
    "workbench.exports": ("export", "export_hdf5", "report", "report_to_print", "save_model", "test_model"),
    "workbench.model": ("load", "add", "remove", "add_tried"),
    "workbench.unsaved": ("save",),
}


@pytest.fixture(scope="module")
def opened(qapp, tmp_path_factory, warm_kernels):
    """Return the window on a rig at rest, and the recording of its first shot, which is shorter than its motion."""
    folder = tmp_path_factory.mktemp("screen")
    (path,) = simulate(folder / "raw", [0.265], 3, sample_rate_hz=6e6, duration_s=0.05)
    chosen = {"levimass_settings": 1, "folder": str(folder / "data"), "tour_done": True, "appearance": "light"}
    (folder / "settings.json").write_text(json.dumps(chosen))
    locale = QLocale()
    QLocale.setDefault(QLocale.c())
    main = open_window(folder, rigs.idle_bench, apart=False)
    main.workbench.candidate_residuals.refresh = lambda: False  # the candidates' own fits are given
    main.show()
    main.resize(2600, 1500)  # after it was shown, so that it is not fitted to the screen
    main.panels.across.setSizes([1800, 800])
    end = time.monotonic() + LONGEST_S
    while main.rig.channels == ():
        QTest.qWait(10)
        assert time.monotonic() < end
    main._timer.stop()
    main.rig.latest = lambda: quiet()
    main.rig.sources = lambda: [("bench", "Simulated bench"), ("scpi:10.0.0.7", "Scope in the network")]
    yield main, path
    for _ in range(2):
        main.close()
    QLocale.setDefault(locale)


@pytest.fixture
def window(opened):
    """Return the window with a new session of four shots."""
    main, path = opened
    main.workbench._switch_to(Session())
    session = main.workbench.session
    first, second = synthetic.shot("run-1", 0.265, 1), synthetic.shot("run-2", 0.2, 2)
    slower = replace(
        second.impact, cor_quasi_static=Quantity(0.98762, 8e-6), force_peak_n=Quantity(0.3861, 0.0012),
        deflection_max_m=Quantity(1.8027e-3, 3e-9), stiffness_slope_n_per_m=Quantity(213.9, 0.4),
    )  # fmt: skip
    for shot in (
        replace(first, path=str(path)),
        replace(second, impact=slower, flags=("clipped", "vibration", "air_assumed")),
        synthetic.shot("run-3", 0.3, 3, problem="no impact was found"),
        synthetic.driven_shot(),
    ):
        session.add(shot)
    session.set_note(SECOND, "pushed by hand")
    main.view_presenter.show_view("whole")
    settle(main)
    return main


def _plain(given) -> str:
    """Return an argument in words: a path, an effect, a list of them."""
    if isinstance(given, list | tuple):
        return f"[{', '.join(map(_plain, given))}]"
    if callable(given):
        return given.__name__
    return str(getattr(given, "words", given)) if not isinstance(given, Path) else given.as_posix()


@pytest.fixture
def calls(window, monkeypatch):
    """Return what the window asks of session and rig, none of which is done."""
    made: list[str] = []

    def recorder(name):
        def called(*given):
            made.append(f"{name}({', '.join(map(_plain, given))})")
            return 1 if name.endswith("reanalyse") else None

        return called

    for owner, names in RECORDED.items():
        thing = window
        for part in owner.split("."):
            thing = getattr(thing, part)
        for name in names:
            monkeypatch.setattr(thing, name, recorder(f"{owner}.{name}"))
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: made.append(f"open {Path(url.toLocalFile()).name}"))
    return made
