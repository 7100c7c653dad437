"""The page that shows why: residuals of all shots on one axis, candidates by evidence, and what each would explain."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF
from PySide6.QtGui import QColor, QEnterEvent, QFocusEvent
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QWidget

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.findings.result import Candidate, FoundEffect
from analysis.drive.catalogue import LAWS
from app.session import candidate_residuals
from app.session.candidate_residuals import CandidateResidual, CandidateResiduals, by_evidence
from app.session.jobs import JobQueues, Jobs
from app.window.controls.theme import LIGHT
from app.window.panels.diagnosis import DiagnosisPanel
from app.window.panels.effects import TRIED, Bar, CandidateBars, EffectRows
from app.window.panels.residuals import explained
from app.window.plots.residual_grid import MOST, Cell, ResidualGrid, SymLog, scale_of
from tests.app import synthetic
from tests.app.on_screen import effect_button

VISCOUS = CATALOGUE["viscous_drag"]
CANDIDATES = (
    Candidate(CATALOGUE["viscous_drag"], 494.0, -580.0),
    Candidate(CATALOGUE["quadratic_drag"], 394.0, -11400.0),
    Candidate(LAWS["lugre_friction"], 3.0, -1000.0),
    Candidate(CATALOGUE["tilt"], 450.0, None),
    Candidate(CATALOGUE["adhesion"], 60.0, -4.0),
)


@pytest.fixture
def shots():
    return [synthetic.shot(f"shot-{n}", 0.2 + 0.05 * n, n) for n in (1, 2, 3)]


@pytest.fixture
def told(shots):
    """A joint diagnosis of three shots whose residual before is a wave, and after is noise."""
    one = synthetic.diagnosis(shots[0])
    parts = [shot.fit.shots[0] for shot in shots]
    waves = [replace(part, residual_m=part.residual_m + _wave(part)) for part in parts]
    before, after = replace(shots[0].fit, shots=tuple(waves)), replace(shots[0].fit, shots=tuple(parts))
    return replace(one, candidates=CANDIDATES, fit_before=before, fit_after=after)


def _wave(part):
    return 1e-6 * np.sin(np.linspace(0.0, 20.0, part.residual_m.size))


def _page(qtbot, told, shots, effects=()):
    page = DiagnosisPanel()
    qtbot.addWidget(page)
    page.resize(1100, 600)
    page.show()
    page.show_diagnosis(told, shots, effects)
    return page


def test_candidates_stand_in_the_order_of_their_evidence():
    """The winner stood second: by its score, 394 behind 494, with a fall of the BIC of 11400 against 580."""
    names = ["quadratic_drag", "lugre_friction", "viscous_drag", "adhesion", "tilt"]
    assert [candidate.name for candidate in by_evidence(CANDIDATES)] == names


def test_columns_have_headings_and_a_line_says_where_evidence_begins(qtbot):
    bars = CandidateBars()
    qtbot.addWidget(bars)
    bars.resize(500, 400)
    bars.show()
    bars.show_candidates(CANDIDATES, {CATALOGUE["quadratic_drag"]})
    qtbot.wait(20)
    labels = {label.text(): label.mapTo(bars, label.rect().topLeft()).y() for label in bars.findChildren(QLabel)}
    assert {"−ΔBIC", "size (σ)", "11400", "394"} <= set(labels)
    (rule,) = (words for words in labels if words.startswith("evidence begins"))
    assert bars.threshold == pytest.approx(10.0 + 2.0 * np.log(5))
    assert labels["viscous drag on the block"] < labels[rule] < labels["adhesion at release"]


def _row(bars: CandidateBars, effect: str) -> list[QWidget]:
    """Return name, bar, evidence and size of a candidate."""
    return [w for w in bars.findChildren(QWidget) if w.property("candidate") == CATALOGUE[effect].key]


def test_a_bar_is_the_logarithm_of_the_evidence_as_a_share_of_the_best(qtbot):
    bars = CandidateBars()
    qtbot.addWidget(bars)
    bars.resize(900, 400)
    bars.show()
    falls = {"quadratic_drag": -999.0, "viscous_drag": -99.0, "adhesion": -9.0, "tilt": 4.0, "frame_vibration": None}
    bars.show_candidates(
        tuple(Candidate(CATALOGUE[name], -7.25, fall) for name, fall in falls.items()),
        {CATALOGUE["quadratic_drag"], CATALOGUE["tilt"]},
    )
    shares = {name: next(w for w in _row(bars, name) if isinstance(w, Bar))._share for name in falls}
    expected = {"quadratic_drag": 1.0, "viscous_drag": 2 / 3, "adhesion": 1 / 3, "tilt": 0.0, "frame_vibration": 0.0}
    assert shares == pytest.approx(expected)
    chosen = {name: next(w for w in _row(bars, name) if isinstance(w, Bar))._chosen for name in falls}
    assert chosen == {name: name == "quadratic_drag" for name in falls}  # what does not pay is not chosen
    texts = {name: [w.text() for w in _row(bars, name) if isinstance(w, QLabel)] for name in falls}
    assert texts["viscous_drag"] == ["viscous drag on the block", "99", "7.25"]
    assert texts["tilt"][1:] == ["-4", "7.25"] and texts["frame_vibration"][1:] == ["–", "7.25"]
    assert texts["quadratic_drag"][0] != CATALOGUE["quadratic_drag"].words
    assert texts["quadratic_drag"][0].endswith(CATALOGUE["quadratic_drag"].words)
    assert "not fitted in full" in _row(bars, "frame_vibration")[0].toolTip()
    assert "not fitted in full" not in _row(bars, "tilt")[0].toolTip()


def test_seven_candidates_are_shown_until_all_are_asked_for(qtbot):
    bars = CandidateBars()
    qtbot.addWidget(bars)
    names = list(CATALOGUE)[:9]
    some = tuple(Candidate(CATALOGUE[name], 5.0, -100.0 + place) for place, name in enumerate(names))

    def shown() -> list[str]:
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        return [name for name in names if _row(bars, name)]

    def button() -> QPushButton:
        (found,) = bars.findChildren(QPushButton)
        return found

    bars.show_candidates(some, set())
    assert shown() == names[:7] and button().text() == "Show all 9"
    button().click()
    assert shown() == names and button().text() == "Show fewer"
    button().click()
    assert shown() == names[:7]
    bars.show_candidates(some[:7], set())
    assert shown() == names[:7] and not bars.findChildren(QPushButton)


def test_keyboard_and_mouse_point_at_a_candidate_and_away(qtbot):
    bars = CandidateBars()
    qtbot.addWidget(bars)
    bars.show_candidates(CANDIDATES, set())
    seen: list[object] = []
    bars.pointed.connect(seen.append)
    for widget in _row(bars, "viscous_drag"):
        QApplication.sendEvent(widget, QFocusEvent(QEvent.Type.FocusIn))
        QApplication.sendEvent(widget, QFocusEvent(QEvent.Type.FocusOut))
        QApplication.sendEvent(widget, QEnterEvent(*[QPointF(2.0, 2.0)] * 3))
        QApplication.sendEvent(widget, QEvent(QEvent.Type.Leave))
    assert seen == 8 * [VISCOUS, None]


def test_a_row_of_an_effect_adds_or_removes_it(qtbot):
    rows = EffectRows()
    qtbot.addWidget(rows)
    found = [FoundEffect(CATALOGUE[name], {}, {}) for name in ("quadratic_drag", "tilt")]
    found[1] = replace(found[1], indistinguishable_from=(VISCOUS, CATALOGUE["adhesion"]))
    added: list[object] = []
    removed: list[object] = []
    rows.add_wanted.connect(added.append)
    rows.remove_wanted.connect(removed.append)
    rows.show_effects(found, (VISCOUS, CATALOGUE["adhesion"]), (CATALOGUE["adhesion"],))
    said = [label.text() for label in rows.findChildren(QLabel)]
    assert len(said) == 4 and "adhesion" not in said[0].lower()
    rivals = f"indistinguishable from: {VISCOUS.words}, {CATALOGUE['adhesion'].words}"
    assert rivals in said[1] and "indistinguishable" not in said[0]
    assert TRIED not in said[2] and TRIED in said[3]
    for key in (CATALOGUE["tilt"].key, VISCOUS.key):
        effect_button(rows, key).click()
    assert added == [[CATALOGUE["tilt"]]] and removed == [VISCOUS]
    (all_of_them,) = (b for b in rows.findChildren(QPushButton) if b.text() == "Add all to the model")
    all_of_them.click()
    assert added[1:] == [[CATALOGUE["quadratic_drag"], CATALOGUE["tilt"]]]
    rows.show_effects(found, (CATALOGUE["tilt"],))  # one is missing: it has its own button
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert sorted(b.text() for b in rows.findChildren(QPushButton)) == ["Add to the model", "Remove from the model"]


@pytest.mark.parametrize(("samples", "parts"), [(1000, 100), (1003, 100), (50, 50), (7, 1)])
def test_a_curve_of_means_lies_where_its_parts_do(samples, parts):
    """The mean of a straight line over a part is its value in the part's middle."""
    line = 3.0 - 0.5 * np.arange(samples)
    edges = np.linspace(0.0, samples, parts + 1) - 0.5
    means = 3.0 - 0.25 * (edges[1:] + edges[:-1])
    over = explained(2.0 * line, means)
    inside = slice(samples // parts, samples - samples // parts) if parts > 1 else slice(samples // 2, samples // 2 + 1)
    assert over.signature_m[inside] == pytest.approx(line[inside], abs=1e-9)
    assert over.remains_m == pytest.approx(2.0 * line - over.signature_m, abs=1e-9)


def test_all_shots_stand_on_one_axis_and_accepting_turns_before_into_after(qtbot, told, shots):
    page = _page(qtbot, told, shots)
    cells = page.why.grid.cells
    assert [cell.title for cell in cells] == [shot.name for shot in shots]
    assert page.why.grid.scale.most == pytest.approx(max(np.nanmax(np.abs(c.before_m)) for c in cells))
    assert all(shot.name in page._of.text() for shot in shots)
    page.show_diagnosis(told, shots, tuple(found.effect for found in told.effects))
    accepted = page.why.grid.cells
    assert all(cell.before_m is None for cell in accepted)
    assert all(np.array_equal(new.after_m, old.after_m) for new, old in zip(accepted, cells, strict=True))
    assert "AFTER" in page.why._heading.text() and "BEFORE" not in page.why._heading.text()


def test_pointing_at_a_candidate_overlays_what_it_would_explain_at_once(qtbot, told, shots):
    page = _page(qtbot, told, shots)
    left = tuple(part.residual_m - 0.7 * _wave(part) for part in told.fit_before.shots)
    page.why.show_found({VISCOUS: CandidateResidual(VISCOUS, left, 44.0)})
    orange = _pixels(page.why.grid, LIGHT.simulated)
    (name,) = (w for w in page.bars.findChildren(QLabel) if w.text() == "viscous drag on the block")
    QApplication.sendEvent(name, QEnterEvent(*[QPointF(2.0, 2.0)] * 3))
    for over, part in zip(page.why.grid.overlays, told.fit_before.shots, strict=True):
        assert np.allclose(over.signature_m + over.remains_m, part.residual_m)
    assert _pixels(page.why.grid, LIGHT.simulated) > orange + 200
    assert "remaining" in page.why.said.text() and "44" in page.why.said.text()
    QApplication.sendEvent(name, QEvent(QEvent.Type.Leave))
    assert page.why.grid.overlays == () and "Point at" in page.why.said.text()
    page.why.point_at(CATALOGUE["tilt"])
    assert "not fitted in full yet" in page.why.said.text()


def test_the_curve_of_the_diagnosis_is_drawn_until_the_candidates_own_fit_is_there(qtbot, told, shots):
    """Pointing at a candidate said "not fitted in full yet" for up to 20 s."""
    sizes = [part.residual_m.size for part in told.fit_before.shots]
    curves = tuple(0.7e-6 * np.sin(np.linspace(0.0, 20.0, 500)).astype(np.float32) for _ in sizes)
    with_curves = tuple(replace(one, explains_m=curves) for one in told.candidates)
    page = _page(qtbot, replace(told, candidates=with_curves), shots)
    page.why.point_at(CATALOGUE["tilt"])  # which was only scored
    assert "first order" in page.why.said.text() and "remaining" in page.why.said.text()
    for over, part, size in zip(page.why.grid.overlays, told.fit_before.shots, sizes, strict=True):
        assert over.signature_m.shape == (size,)
        assert np.allclose(over.signature_m, 0.7 * _wave(part), atol=2e-8)
        assert np.allclose(over.signature_m + over.remains_m, part.residual_m)
    page.why.point_at(VISCOUS)
    assert "as fitted in the diagnosis" in page.why.said.text() and len(page.why.grid.overlays) == 3
    left = tuple(part.residual_m - 0.9 * _wave(part) for part in told.fit_before.shots)
    page.why.show_found({VISCOUS: CandidateResidual(VISCOUS, left, 44.0)})
    page.why.point_at(VISCOUS)
    assert "44" in page.why.said.text() and "diagnosis" not in page.why.said.text()
    assert np.array_equal(page.why.grid.overlays[0].remains_m, left[0])


def test_the_best_candidate_and_its_neighbour_stand_side_by_side(qtbot, told, shots):
    page = _page(qtbot, told, shots)
    assert not page.why.neighbour.isEnabled()
    found = {}
    for effect, share in ((CATALOGUE["quadratic_drag"], 0.0), (LAWS["lugre_friction"], 0.4)):
        left = tuple(part.residual_m + share * _wave(part) for part in told.fit_after.shots)
        found[effect] = CandidateResidual(effect, left, 1.0 + 100 * share)
    page.why.show_found(found)
    page.why.neighbour.click()
    cells = page.why.grid.cells
    assert len(cells) == 6
    assert np.array_equal(cells[0].after_m, found[CATALOGUE["quadratic_drag"]].left_m[0])
    assert np.array_equal(cells[1].after_m, found[LAWS["lugre_friction"]].left_m[0])
    assert "41" in page.why.said.text()


def test_tables_and_limits_are_folded_beneath(qtbot, told, shots):
    page = _page(qtbot, told, shots)
    assert not page.residuals.isVisible() and not page._blind.isVisible()
    page.fold.click()
    assert page.residuals.isVisible() and page._blind.isVisible()


def test_a_diagnosis_names_its_shots_from_the_first_second(qtbot):
    page = DiagnosisPanel()
    qtbot.addWidget(page)
    page.show()
    page.show_progress("starting", 0.0, "diagnosis of shots 1, 2, 3")
    assert "shots 1, 2, 3" in page._of.text() and page.progress.isVisible()
    page.show_progress(None, 0.0)
    assert page._of.text() == ""


def test_candidates_are_fitted_while_nothing_else_is_to_be_done(told, shots, monkeypatch):
    asked, go = [], threading.Event()

    def fitted(shots, base, effects, *, progress, cancelled):
        asked.append(effects[-1])
        while not go.wait(0.01):
            if cancelled():
                raise candidate_residuals.AnalysisError("given up")
        return CandidateResidual(effects[-1], (np.zeros(3),) * len(shots), 1.0)

    monkeypatch.setattr(candidate_residuals, "candidate_residual", fitted)
    work = JobQueues(None)
    try:
        whole = CandidateResiduals(work)
        whole.show(told, shots)
        whole.refresh()
        until(lambda: asked == [CATALOGUE["quadratic_drag"]])
        other = work.jobs.submit("export", lambda _, __: None, "export")  # it comes first
        assert other.done.wait(5.0)
        whole.first(CATALOGUE["tilt"])
        go.set()

        def refreshed():
            assert list(work.collect_results()) == []
            return whole.refresh()

        until(lambda: refreshed() or not whole._wanted)
        until(lambda: (refreshed(), not whole._wanted and len(whole.found) == 5)[1])
        assert asked[1] == CATALOGUE["tilt"] and set(whole.found) == {candidate.effect for candidate in CANDIDATES}
        whole.show(None, [])
        assert whole.found == {}
    finally:
        go.set()
        work.close()


def test_work_that_makes_way_is_cancelled_by_any_other():
    jobs, held = Jobs(), threading.Event()
    try:
        first = jobs.submit("hold", lambda _, __: held.wait(5.0), "hold")
        yielding = jobs.submit("candidate", lambda _, __: None, "why")
        assert not yielding.cancelled
        jobs.submit("open", lambda _, __: None, "open")
        assert yielding.cancelled and not first.cancelled
    finally:
        held.set()
        jobs.close()


def test_the_axis_is_linear_in_the_noise_and_logarithmic_beyond():
    scale = scale_of([np.array([1e-6, -2e-6])], 2e-10)
    assert scale == SymLog(2e-10, 2e-6)
    at = scale.place(np.array([-2e-6, -2e-10, 0.0, 2e-10, 2e-8, 2e-6, np.nan, 1.0]))
    assert at[0] == -1.0 and at[2] == 0.0 and at[5] == 1.0 == at[7] and np.isnan(at[6])
    assert 0.0 < at[3] < at[4] < at[5] and at[1] == -at[3]
    assert scale.ticks() == pytest.approx([-1e-6, -1e-8, 0.0, 1e-8, 1e-6])  # every second decade, none in the noise
    assert SymLog(2e-9, 2e-6).ticks() == pytest.approx([-1e-6, -1e-7, -1e-8, 0.0, 1e-8, 1e-7, 1e-6])


def _rows(widget, colour):
    """Return the mean row of a colour's pixels, from left to right, for every stretch of columns that has some."""
    image = widget.grab().toImage()
    wanted, out = QColor(colour).rgb(), []
    for x in range(image.width()):
        rows = [y for y in range(image.height()) if image.pixel(x, y) == wanted]
        if rows and (not out or out[-1][0] < x - 1):
            out.append([x, x, []])
        if rows:
            out[-1][0] = x
            out[-1][2] += rows
    return [(first, last, sum(rows) / len(rows)) for last, first, rows in out]


def _flat(value_m):
    return Cell(f"{value_m:g}", np.linspace(0.0, 60.0, 500), None, np.full(500, value_m), np.full(500, 1e-9))


def test_each_shot_stands_in_its_place_and_each_value_at_its_height(qtbot):
    grid = ResidualGrid()
    qtbot.addWidget(grid)
    grid.resize(1000, 300)
    grid.show()
    grid.show_cells([_flat(value) for value in (1e-6, -1e-6, 0.0, 3e-8)])
    drawn = _rows(grid, LIGHT.residual)
    assert len(drawn) == 4
    (_, _, top), (_, _, bottom), (_, _, middle), (_, _, some) = drawn
    assert top < some < middle < bottom and middle == pytest.approx((top + bottom) / 2, abs=1.5)
    share = float(grid.scale.place(np.array([3e-8]))[0])
    assert 0.2 < share < 0.8 and some == pytest.approx(middle - share * (middle - top), abs=1.5)
    wide = [last - first for first, last, _ in drawn]
    assert max(wide) - min(wide) <= 2 and sum(wide) > 0.75 * grid.width()
    grid.show_cells([_flat(1e-6 if k == 5 else 0.0) for k in range(6)])  # four side by side, two below them
    drawn = _rows(grid, LIGHT.residual)
    assert len(drawn) == 4 and drawn[0][2] > drawn[1][2] + 20 and drawn[2][2] == drawn[3][2]
    assert grid.accessibleDescription().startswith("6 shots; up to 1")
    grid.show_cells([_flat(0.0) for _ in range(MOST + 3)])
    assert len(grid.cells) == MOST


def _pixels(widget, colour):
    image = widget.grab().toImage()
    wanted = QColor(colour).rgb()
    return sum(image.pixel(x, y) == wanted for x in range(0, image.width(), 2) for y in range(0, image.height(), 2))


def until(true):
    end = time.monotonic() + 20.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)
