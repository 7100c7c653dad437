"""What reports and exported tables say, as text, against what is written down in ``written/``; curves in plot units."""

import csv
import re
from dataclasses import fields, replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Candidate, Errors, PredictedShot, PredictionTest, Standing, Verdict
from analysis.shot.impact import Disturbance, VibrationLine
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Air, Channel, Plate, Recording, Role, Setup
from analysis.shot.shot import PlotNote
from app.report.exports import export, export_laws, export_prediction
from app.report.page import report_of
from instrument.files.recording_writer import write_recording
from tests.app import synthetic
from tests.app.window.scene import check

KEPT = Path(__file__).parent / "written"
MADE = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
PLATE = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8510.0, 131e9)
DRAG, VISCOUS, TILT = effects_named(("quadratic_drag", "viscous_drag", "tilt"))
_PLACE = re.compile(r"[ML](-?[\d.]+) (-?[\d.]+)")


class Page(HTMLParser):
    """The lines of a report: paragraphs, rows of tables, and of each drawing its words and curves."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._cells: list[str] = []
        self._text = ""
        self._in: list[str] = []
        self._drawing: Drawing | None = None
        self._given: dict[str, str | None] = {}
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self._given = dict(attrs)
        if tag == "br":
            self._text += " / "
        if tag == "svg":
            self._drawing = Drawing(self._given)
        elif self._drawing is not None:
            self._drawing.add(tag, self._given)
        elif tag == "span":
            self._text += f" [{self._given['class']}: "
        elif tag in ("p", "tr", "h1", "h2", "h3", "h5", "li", "figcaption", "title", "section", "figure"):
            self._say()
        if tag not in ("meta", "br", "path", "line", "rect", "circle"):
            self._in.append(tag)

    def handle_startendtag(self, tag, attrs):
        if self._drawing is not None:
            self._drawing.add(tag, dict(attrs))

    def handle_endtag(self, tag):
        self._in.pop()
        if tag == "svg":
            assert self._drawing is not None
            self.lines += self._drawing.lines()
            self._drawing = None
        elif self._drawing is not None:
            return
        elif tag in ("td", "th"):
            self._cells.append(" ".join(self._text.split()))
            self._text = ""
        elif tag == "span":
            self._text += "]"
        elif tag == "tr":
            self.lines.append("| " + " | ".join(self._cells))
            self._cells = []
        elif tag in ("p", "h1", "h2", "h3", "h5", "li", "figcaption", "title"):
            self._say({"h1": "# ", "h2": "## ", "h3": "### ", "h5": "##### ", "li": "- "}.get(tag, ""))

    def handle_data(self, data):
        if "style" in self._in:
            return
        if self._drawing is not None:
            self._drawing.say(data)
        else:
            self._text += data

    def _say(self, before=""):
        if words := " ".join(self._text.split()):
            self.lines.append(before + words)
        self._text = ""


class Drawing:
    """One svg: what is drawn, in the units of its axes, which the labels of the ticks give."""

    def __init__(self, given):
        self._words = given["aria-label"]
        self._items: list[tuple[str, dict[str, str | None]]] = []
        self._texts: list[tuple[dict[str, str | None], str]] = []

    def add(self, tag, given):
        self._items.append((tag, given))

    def say(self, text):
        self._texts.append((self._items[-1][1] | {"tag": self._items[-1][0]}, text))

    def _axis(self, kind, key):
        """Return the map from pixels to the axis, and the labels of the ticks."""
        seen = [(float(given[key] or 0.0), text) for given, text in self._texts if given.get("class") == kind]
        at = [place for place, _ in seen]
        values = [float(text.replace("−", "-")) for _, text in seen]
        slope = (values[-1] - values[0]) / (at[-1] - at[0])
        return (lambda place: values[0] + slope * (place - at[0])), [text for _, text in seen]

    def lines(self):
        x, x_labels = self._axis("tick-x", "x")
        y, y_labels = self._axis("tick-y", "y")
        found = [f"drawn: {self._words}", f"    ticks {' '.join(x_labels)}; {' '.join(y_labels)}"]

        def at(axis, *pixels):
            return [_to(axis(1.0) - axis(0.0), axis(pixel)) for pixel in pixels]

        for tag, given in self._items:
            kind = given.get("class")
            if tag == "path":
                d = given["d"] or ""
                places = np.array([[float(a), float(b) + SHIFT] for a, b in _PLACE.findall(d)]).reshape(-1, 2)
                if len(places):
                    (left, right), (top, bottom) = ((p.min(), p.max()) for p in places.T)
                    across, up = at(x, left, right), at(y, bottom, top, places[0, 1], places[-1, 1])
                    closed = ", closed" if d.endswith("Z") else ""
                    found.append(
                        f"    {kind}: {d.count('M')} parts{closed}, x {across[0]} to {across[1]}, "
                        f"y {up[0]} to {up[1]}, first {up[2]}, last {up[3]}"
                    )
            elif kind in ("mark", "zero", "bar"):
                across = "" if kind == "zero" else f" x {at(x, float(given['x1']))[0]}"
                up = [] if kind == "mark" else at(y, float(given["y1"]) + SHIFT, float(given["y2"]) + SHIFT)
                found.append(f"    {kind}:{across}{' y ' if up else ''}{' to '.join(up)}")
            elif tag == "circle":
                found.append(f"    {kind}: {at(x, float(given['cx']))[0]}, {at(y, float(given['cy']) + SHIFT)[0]}")
        for given, text in self._texts:
            if given.get("class") in ("remark-left", "remark-right") or given["tag"] == "title":
                found.append(f"    {given.get('class') or 'hover'}: {text}")
        return found


SHIFT = 3.5  # pixels of a label below its tick


def _to(pixel, value):
    """Return a value of an axis to three pixels, finer than which no one reads a figure."""
    step = abs(3 * pixel)
    return f"{step * round(value / step) + 0.0:.4g}"


def page(*shots, **given):
    """Return the lines of a report without what differs between machines."""
    lines = Page(report_of(shots, made_at=MADE, **given)).lines
    return [re.sub(r"levimass \d\S+,.*? on \S+ \w+", "PROGRAM", line) for line in lines]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return the metadata file of a small recording whose every count is known."""
    counts = (np.arange(3000)[:, None] % (7, 11, 13)).astype(np.int16)
    channels = (Channel(Role.REFERENCE, 1e-3), Channel(Role.MEASUREMENT, 2e-3, 0.1), Channel(Role.SWITCH, 1e-2))
    setup = Setup(17.85e-3, digitizer_bits=12)
    return write_recording(Recording("shot-1", counts, 1e6, channels, setup), tmp_path_factory.mktemp("r") / "shot-1")


def _rig():
    return Setup(
        17.85e-3, 1e-6, 632.991354e-9, None, Air(21.0, 100_300.0, 45.0), 2.73e6, PLATE, 12,
        extra={"made by": "hand", "nested": {"a": 1.5}},
    )  # fmt: skip


def test_the_report_of_one_shot(recorded):
    shot = synthetic.shot("run-1", 0.265, 1)
    notes = (
        PlotNote("velocity", synthetic.TOUCH_S + 0.02, 0.1, "a knock?"),
        PlotNote("force vs deflection", 1.5e-3, 0.3, "a kink"),
        PlotNote("gap", synthetic.TOUCH_S + 0.003, 5e-5, "lifts off"),
        PlotNote("residual of force", synthetic.TOUCH_S - 0.01, 2e-3, "rings"),
    )
    drag = {f"{DRAG.key}.coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    settings = replace(shot.settings, effects=(DRAG,), corrections=(("moving_mass_kg", 0.0179),))
    fit = replace(
        shot.fit, effects=(DRAG,), parameters=shot.fit.parameters | drag,
        covariance=np.diag([1.0, 2.0, 3.0, 4.0, 5.0]) + 0.5,
    )  # fmt: skip
    lines = (VibrationLine(Quantity(49.98, 0.01), Quantity(2.1e-9, 1e-10), 0.4),)
    disturbance = Disturbance(
        lines, 1.3e-9, 4.1e-7, ((0.012, 0.014),), {"cor_quasi_static": 0.42, "force_peak_n": 0.01}
    )
    whole = replace(
        shot, path=str(recorded), setup=_rig(), settings=settings, fit=fit, flags=("vibration", "clipped"),
        note="pushed by hand", plot_notes=notes, impact=replace(shot.impact, disturbance=disturbance),
        seconds={"demodulation": 0.0123, "fit": 0.4},
    )  # fmt: skip
    said = page(whole, tried=(DRAG,))
    check("one-shot", {"a shot": [line.replace(str(recorded.parent), "FOLDER") for line in said]}, KEPT)


def _candidates():
    size = {"coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    return (
        Candidate(DRAG, 60.0, -812.0, size, Standing.IN_MODEL),
        Candidate(VISCOUS, 58.0, -790.0, {"coefficient_n_s_per_m": Quantity(4e-4, 1e-5)}, Standing.BEHIND_ANOTHER),
        Candidate(TILT, 3.0, None, {}, Standing.SCORED_ONLY),
    )


def _varied(shot, by):
    """Return a shot whose numbers differ by a share of theirs from those of the others."""

    def of(reading):
        return replace(reading, value=reading.value * (1.0 + by)) if isinstance(reading, Quantity) else reading

    kept = ("touch_time_s", "release_time_s", "turnaround_time_s", "cor_kinetic")
    names = [f.name for f in fields(shot.impact) if isinstance(getattr(shot.impact, f.name), Quantity)]
    impact = replace(shot.impact, **{name: of(getattr(shot.impact, name)) for name in names if name not in kept})
    kinetic = impact.cor_kinetic
    kinetic = replace(kinetic, **{f.name: of(getattr(kinetic, f.name)) for f in fields(kinetic)})
    fit = replace(shot.fit, parameters={name: of(value) for name, value in shot.fit.parameters.items()})
    return replace(shot, impact=replace(impact, cor_kinetic=kinetic), fit=fit)


def test_the_report_of_a_session(recorded):
    first, second, third = (
        _varied(synthetic.shot(f"run-{n}", 0.2 + 0.06 * n, n), by) for n, by in ((1, 0.0), (2, 2e-3), (3, -1e-3))
    )
    slower = replace(second.impact, cor_quasi_static=Quantity(0.98762, 8e-6), force_peak_n=Quantity(0.45, 0.002))
    third_impact = replace(third.impact, cor_quasi_static=Quantity(0.98771, 9e-6), cor_impulse=NotSeen("no force"))
    shots = [
        first, replace(second, impact=slower, note="with care"), replace(third, impact=third_impact),
        synthetic.shot("failed", 0.3, 4, problem="no impact was found"),
    ]  # fmt: skip
    one = synthetic.diagnosis(first)
    both = replace(first.fit, shots=(first.fit.shots[0], second.fit.shots[0], third.fit.shots[0]))
    half = replace(both, shots=tuple(replace(p, residual_m=0.5 * np.asarray(p.residual_m)) for p in both.shots))
    found = replace(one, candidates=_candidates(), fit_before=both, fit_after=half, laws=(synthetic.learned_law(),))
    base, model = Errors(62e-9, 40e-6, 3.1e-3, 3800.0), Errors(1.1e-9, 8e-6, 2e-3, 1.01)
    foretold = PredictionTest(
        "paper", (DRAG,), base, model,
        (
            PredictedShot("run-1", True, base, model),
            PredictedShot("run-2", False, base, replace(model, displacement_rms_m=3e-9)),
            PredictedShot("failed", False, None, None, "no motion"),
        ),
    )  # fmt: skip
    lines = page(*shots, diagnosis=found, prediction=foretold, next_shots="One shot at 0.6 m/s.")
    end = next(n for n, line in enumerate(lines) if line == "## run-1")
    parts = {"session, diagnosis and prediction": lines[:end]}
    parts["the headings of each shot"] = [line for line in lines[end:] if line.startswith("#")]
    unexplained = replace(found, verdict=Verdict.UNEXPLAINED, effects=(), laws=(), fit_after=both, candidates=())
    parts["unexplained"] = page(*shots[:1], diagnosis=replace(unexplained, fit_before=both))[2:20]
    check("session", parts, KEPT)


def test_reports_of_a_drive_of_a_shot_that_failed_and_of_none():
    plain = replace(
        synthetic.shot("plain", 0.2, 1), fit=None, fit_problem="it took too long", setup=None, trigger_time_s=None,
        sample_rate_hz=None, samples=None, started_at=None,
    )  # fmt: skip
    parts = {"a drive": page(synthetic.driven_shot()), "none": page()}
    parts["failed"] = page(synthetic.shot("failed", 0.3, 4, problem="no impact was found"))
    parts["of which little is known"] = page(plain)
    check("others", parts, KEPT)


def _table(path, most=6):
    """Return the head of a table, a column a line with its first values."""
    rows = list(csv.reader(path.open(encoding="utf-8")))
    numbers = [[_short(cell) for cell in column[1 : most + 1]] for column in zip(*rows, strict=True)]
    return [
        f"{len(rows) - 1} rows",
        *(f"{head}: {' | '.join(values)}" for head, values in zip(rows[0], numbers, strict=True)),
    ]


def _short(cell):
    try:
        return f"{float(cell):.6g}"
    except ValueError:
        return cell


def test_exported_tables(tmp_path):
    first, second = synthetic.shot("run-1", 0.265, 1), _varied(synthetic.shot("run 2/b", 0.2, 2), 2e-3)
    shots = [first, replace(second, note="=1+1"), synthetic.shot("run-1", 0.3, 4, problem="no impact was found")]
    files = export(shots, tmp_path)
    parts = {"files": [path.name for path in files]}
    parts |= {path.name: _table(path) for path in files if path.name != "budget.csv"}
    budget = list(csv.reader((tmp_path / "budget.csv").open(encoding="utf-8")))
    parts["budget.csv"] = [" | ".join(map(_short, row)) for row in budget[:40]] + [f"{len(budget)} rows"]
    one = synthetic.diagnosis(first)
    (law,) = export_laws(replace(one, laws=(synthetic.learned_law(),)), tmp_path)
    parts[law.name] = _table(law)
    base, model = Errors(62e-9, 40e-6, float("nan"), 3800.0), Errors(1.1e-9, 8e-6, 2e-3, 1.01)
    foretold = PredictionTest("paper", (), base, model, (PredictedShot("run-1", True, base, None, "no fit"),))
    parts["foretold.csv"] = _table(export_prediction(foretold, tmp_path))
    check("tables", parts, KEPT)
