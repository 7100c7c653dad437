"""A session in the real window, and what is shown compared with what was written down."""

import os
import time
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
import pytest
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Candidate, Standing
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Role
from instrument.capture.acquisition import State
from instrument.capture.snapshot import SignalLine, Snapshot
from instrument.live.live_view import ChannelSignal, empty_view
from instrument.trigger.light_switch import Level
from tests.app import synthetic
from tests.app.window import shown

KEPT = Path(__file__).parent / "screen"
WRITE = bool(os.environ.get("LEVIMASS_WRITE_SCREEN"))
LONGEST_S = 180.0
FIRST, SECOND, FAILED, DRIVEN = 1, 2, 3, 4  # shots of the session
DRAG, VISCOUS, FRICTION, TILT, ADHESION = effects_named(
    ("quadratic_drag", "viscous_drag", "coulomb_friction", "tilt", "adhesion")
)


def settle(window, until=lambda: True):
    """Pull until the jobs are done, and lay out."""
    end = time.monotonic() + LONGEST_S
    while True:
        window.pull()
        QTest.qWait(5)
        open_jobs = window.workbench.jobs.open_jobs + window.workbench.short_jobs.open_jobs
        if not open_jobs and until():
            window.pull()
            QTest.qWait(5)
            return
        assert time.monotonic() < end, "the window does not come to rest"


def quiet(**changes):
    """Return the snapshot of a rig at rest with sound signals."""
    signals = (
        ChannelSignal(Role.REFERENCE, 0.812, 1.0, 0.0, 2.730121e6, 41.3),
        ChannelSignal(Role.MEASUREMENT, 0.643, 1.0, 0.0, 2.730118e6, 38.2),
        ChannelSignal(Role.SWITCH, 4.1, 5.0, 0.0, None, None),
    )
    line = SignalLine(signals, Level.HIGH, 3, (1.2, 3.4), 412 * 10**9, PurePosixPath("/data/rig"))
    return replace(Snapshot(State.IDLE, time.monotonic(), False, "", "", line, empty_view()), **changes)


def show(window, page, *numbers):
    window.panels.tabs.setCurrentIndex(page)
    window.panels.table.select(list(numbers))
    settle(window)
    return window.panels


def check(name: str, parts: dict[str, list[str]], folder: Path = KEPT) -> None:
    """Compare what is shown with the file of that name; or write it."""
    text = [line.rstrip() for head, lines in parts.items() for line in (f"# {head}", *shown.shortened(lines), "")]
    file = folder / f"{name}.txt"
    if WRITE:
        folder.mkdir(exist_ok=True)
        file.write_text("\n".join(text), encoding="utf-8")
        return
    kept = file.read_text(encoding="utf-8").split("\n")
    kept += [""] * (len(text) - len(kept))
    if len(text) == len(kept) and all(map(shown.same, kept, text)):
        return
    pytest.fail("\n".join(["shown differently:", *shown.differences(kept, text)]), pytrace=False)


def of(widget: QWidget) -> list[str]:
    QTest.qWait(1)  # what was added is laid out
    return shown.of_widget(widget)


def bare(widget: QWidget) -> list[str]:
    """Return the same without hovers and choices, which are written down once."""
    return [line for line in of(widget) if "hover: " not in line and " = " not in line]


def found_by(shots):
    """Return a diagnosis of two shots that found drag, with candidates of every standing."""
    one = synthetic.diagnosis(shots[0])
    both = replace(shots[0].fit, shots=(shots[0].fit.shots[0], shots[1].fit.shots[0]))
    after = replace(
        both, shots=tuple(replace(part, residual_m=0.3 * np.asarray(part.residual_m)) for part in both.shots)
    )
    size = {"coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    bend = tuple(np.linspace(-k * 1e-9, k * 2e-9, 50) for k in (1, 2))
    candidates = (
        Candidate(DRAG, 60.0, -812.0, size, Standing.IN_MODEL, explains_m=bend),
        Candidate(
            VISCOUS,
            58.0,
            -790.0,
            {"coefficient_n_s_per_m": Quantity(4e-4, 1e-5)},
            Standing.BEHIND_ANOTHER,
            explains_m=bend,
        ),
        Candidate(FRICTION, 12.0, 3.5, {"force_n": Quantity(1e-6, 2e-6)}, Standing.DOES_NOT_PAY),
        Candidate(TILT, 3.0, None, {}, Standing.SCORED_ONLY, explains_m=bend),
        Candidate(ADHESION, 1.0, None),
    )
    return replace(one, candidates=candidates, fit_before=both, fit_after=after)
