"""The report: one file that needs nothing else, holds every number, and takes nothing foreign for markup."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pypdfium2
import pytest

from analysis.collision.effects import effects_named
from analysis.collision.effects.row import Acts, Effect
from analysis.diagnosis.findings.result import BlindSpot, FoundEffect, Remainder
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Air, Plate, Setup
from analysis.uncertainty.gum_budget import budget
from app.command_line.cli import main
from app.report.page import MAX_DRAWN, report_of
from app.report.pdf import figure_rules, write_pdf
from app.report.provenance import taken_with
from app.report.shot_figures import figures
from app.report.svg_plot import Line, Plot, decimate_curve, draw, ticks
from app.words.markup import Markup, tag
from app.words.markup import table as tag_table
from instrument.files.recording_file import read_recording
from instrument.files.recording_writer import write_recording
from tests.app.synthetic import diagnosis, shot

MADE = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
HOSTILE = "<script>alert(1)</script>\" onload='x' &amp; \x00\ud800</style>"
VOID = {"meta", "br", "path", "line", "rect", "circle"}
KNOWN = VOID | {
    *("html", "head", "title", "style", "body", "header", "footer", "section", "div", "h1", "h2", "h3", "h5", "p"),
    *("b", "span", "ul", "li", "table", "thead", "tbody", "tr", "th", "td", "figure", "figcaption", "svg", "text"),
}


class Elements(HTMLParser):
    """Every element with its attributes, the text, and whether all that opened was closed in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(page)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def whole() -> str:
    one = shot()
    return report_of([one], diagnosis(one), made_at=MADE)


def test_it_needs_nothing_else(whole: str) -> None:
    elements = Elements(whole).elements
    names = {name for name, _ in elements}
    assert names.isdisjoint({"script", "link", "img", "iframe", "object", "use", "image"})
    attributes = [(key, value) for _, given in elements for key, value in given.items()]
    assert not [key for key, _ in attributes if key.startswith("on") or key in ("src", "xlink:href", "style")]
    assert all(str(value).startswith("#") for key, value in attributes if key == "href")
    assert "url(" not in whole and "@import" not in whole and "http" not in whole.replace("http-equiv", "")


def test_every_element_is_one_and_the_sections_stand_in_their_order(whole: str) -> None:
    page = Elements(whole)
    assert {name for name, _ in page.elements} <= KNOWN
    assert re.findall("<h3>(.*?)</h3>", whole.split('id="shot-1"')[1]) == [
        *("Numbers", "Model", "Figures", "Uncertainty budget", "Taken with", "Analysed with", "How to reproduce")
    ]


def test_it_holds_every_number_and_what_makes_it_uncertain(whole: str) -> None:
    text, one = Elements(whole).text, shot()
    for entry in budget(one).quantities:
        factor = 1e-9 if entry.unit == "Pa" else 1.0
        if entry.unit not in ("s", "m", "kg"):
            assert str(entry.quantity.scaled(factor)) in text, entry.key
        assert entry.words in text
    assert one.fit is not None
    for value in one.fit.parameters.values():
        assert str(value) in text
    for said in ("the second flight is shorter than the filter", "timebase", "type A", "10000", "2026-03-01 12:00 UTC"):
        assert said in text
    for label in ("beat (MHz)", "velocity (m/s)", "force (N)", "gap (µm)", "displacement (nm)", "deflection of"):
        assert label in text


def test_the_diagnosis_is_in_it(whole: str) -> None:
    text = Elements(whole).text
    for said in ("effect found", "quadratic drag on the block", "0.00190 ± 0.00010 N s²/m²",
                 "cannot distinguish it from", "viscous drag", "a wrong wavelength", "two more shots, at 0.1",
                 "validation shot", "3800", "1.01"):  # fmt: skip
        assert said in text
    one = shot(count=8000)
    assert one.fit is not None
    found = replace(diagnosis(one), fit_after=replace(one.fit, effects=effects_named(("quadratic_drag",))))
    text = Elements(report_of([one], found, made_at=MADE)).text
    assert "shot-1 (nm)" in text and "before and after." in text and "with quadratic drag on the block" in text
    assert "Diagnosis" not in Elements(report_of([shot()], None, made_at=MADE)).text


def test_planned_shots_stand_in_the_place_of_a_general_hint() -> None:
    one = shot()
    found = diagnosis(one)
    assert "two more shots, at 0.1 and 0.32 m/s" in Elements(report_of([one], found, made_at=MADE)).text
    text = Elements(report_of([one], found, made_at=MADE, next_shots="Two shots at 0.45 m/s would tell")).text
    assert "Two shots at 0.45 m/s would tell" in text
    assert "a shot, some time" not in text


def test_an_effect_that_no_diagnosis_named_is_told(tmp_path: Path) -> None:
    one = shot(count=8000)
    assert one.fit is not None
    fit = replace(one.fit, effects=effects_named(("tilt", "adhesion")))
    tried = replace(one, fit=fit, path=str(tmp_path / "a"), settings=replace(one.settings, effects=fit.effects))
    text = Elements(report_of([tried], made_at=MADE, tried=effects_named(("adhesion", "cyclic_error")))).text
    assert "not found by a diagnosis: adhesion at release." in text  # and not the one that is not in the model
    assert 'tried = ["adhesion"]' in text
    assert "not found by a diagnosis" not in Elements(report_of([tried], made_at=MADE)).text


def test_weights_on_the_block_are_told() -> None:
    one = shot()
    assert one.motion is not None
    laden = replace(one, motion=replace(one.motion, moving_mass_kg=one.motion.moving_mass_kg + 0.05))
    text = Elements(report_of([one, laden], diagnosis(one), made_at=MADE)).text
    assert "Based on 2 shots: shots 1 as found, 2 with 50.00 g added." in text


def test_who_was_taken_on_which_plate_is_told() -> None:
    one = shot()
    assert one.motion is not None
    thin = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)
    first = replace(one, motion=replace(one.motion, plate=thin))
    other = replace(one, motion=replace(one.motion, plate=replace(thin, thickness_m=0.5e-3)))
    text = Elements(report_of([first, one, other], diagnosis(one), made_at=MADE)).text
    assert "Based on 3 shots: shots 1-2 on plate 1, 3 on plate 2." in text


def test_nothing_foreign_becomes_markup() -> None:
    one = shot()
    assert one.setup is not None and one.fit is not None
    bad = replace(
        one,
        name=HOSTILE,
        note=HOSTILE,
        flags=(HOSTILE,),
        started_at=HOSTILE,
        path=f"/nowhere/{HOSTILE}.sigmf-meta".replace("\x00", ""),
        setup=replace(one.setup, extra={HOSTILE: {HOSTILE: HOSTILE}}),
        fit=replace(one.fit, parameters={HOSTILE: Quantity(1.0, 0.1, HOSTILE)}, covariance=np.eye(1)),
    )
    bad_one = Effect(HOSTILE, HOSTILE, Acts.ON_BLOCK, (), "")
    left = Remainder(1e-9, 1e-10, (), imitated_by=(bad_one,))
    said = replace(diagnosis(one), remainder=left, blind_spots=(BlindSpot(bad_one, HOSTILE, 1.0),))
    said = replace(said, effects=(FoundEffect(bad_one, {HOSTILE: Quantity(1, 1)}, {HOSTILE: 1.0}, (bad_one,)),))
    page = report_of([bad, replace(bad, problem=HOSTILE, motion=None, impact=None, fit=None)], said)
    elements = Elements(page)
    assert "script" not in {name for name, _ in elements.elements}
    assert "alert(1)" in elements.text
    assert not [key for _, given in elements.elements for key in given if key.startswith("on")]
    assert page.count("<style>") == page.count("</style>") == 1
    assert "\x00" not in page and page.encode("utf-8")


def test_a_session_has_overlay_trends_and_each_shot() -> None:
    shots = [shot(f"shot-{i}", 0.2 + 0.03 * i, seed=i, count=9500) for i in (1, 2, 3)]
    failed = shot("shot-4", problem="no impact was seen", count=8000)
    page = Elements(report_of([*shots, failed], made_at=MADE))
    assert {f"shot-{i}" for i in (1, 2, 3, 4)} <= {given.get("id") for _, given in page.elements}
    curves = {given.get("class") for name, given in page.elements if name == "path"}
    assert {"series-0", "series-1", "series-2"} <= curves
    for said in ("Session of 4 shots", "repeatability", "slope per m/s", "no impact was seen"):
        assert said in page.text
    assert sum(name == "circle" for name, _ in page.elements) >= 3 * 8  # points of the trends


def test_many_shots_are_told_without_figures() -> None:
    one = shot(count=8000)
    page = Elements(report_of([replace(one, name=f"s{i}") for i in range(MAX_DRAWN + 1)], made_at=MADE))
    assert "left out" in page.text
    assert not [1 for name, given in page.elements if name == "path" and given.get("class") == "measured"]


def test_no_peak_is_lost_and_no_more_than_two_points_a_pixel() -> None:
    random = np.random.default_rng(3)
    x = np.arange(100_000) / 7.0
    y = random.normal(size=x.size)
    y[61_234], y[777] = 50.0, -40.0
    y[20_000:30_000] = np.nan
    at, values = decimate_curve(x, y, x[0], x[-1], 600)
    assert at.size <= 1200
    assert np.nanmax(values) == 50.0 and np.nanmin(values) == -40.0
    assert np.isnan(values[(at > x[20_500]) & (at < x[29_500])]).all()
    svg = draw(Plot("t (ms)", "y", (Line(x, y, "measured"),)))
    path = re.search(r'class="measured" d="([^"]*)"', svg)
    assert path is not None and path[1].count("M") == 2  # the gap parts the curve
    assert "nan" not in svg


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 1.0), (-0.31, 0.27), (2.7299, 2.7301), (-5e-9, 3e-9), (1e6, 1e6 + 1), (3.0, 3.0)]
)
def test_ticks_are_round_and_told_apart(low: float, high: float) -> None:
    places, decimals = ticks(low, high, 6)
    assert (2 if high > low else 1) <= len(places) <= 6
    labels = [f"{p:.{decimals}f}" for p in places]
    assert len(set(labels)) == len(labels)
    assert all(low - 1e-9 * abs(low) <= p <= high + 1e-9 * abs(high) for p in places)
    if high > low:
        assert len(places) >= 2


def test_text_is_escaped_once() -> None:
    assert tag("p", "a<b", Markup("<br>"), title='"x"') == '<p title="&quot;x&quot;">a&lt;b<br></p>'


def test_report_of_a_replay_names_the_very_data(recordings: Path, tmp_path: Path) -> None:
    source = read_recording(recordings / "plain" / "shot-1")
    meta = write_recording(replace(source, note="<b>bold</b>"), tmp_path / "shot-1")
    out = tmp_path / "report.html"
    assert main(["--replay", str(meta), "--no-diagnose", "--report", str(out)]) == 0
    page = out.read_text(encoding="utf-8")
    sha = json.loads(meta.read_text())["global"]["core:sha512"]
    text = Elements(page).text
    assert sha in text and "as written when the shot was taken" in text
    assert "&lt;b&gt;bold" in page and "<b>bold" not in page
    assert "channel 1, reference" in text and "levimass replay 'shot-1.sigmf-meta'" in text


def test_a_report_that_cannot_be_written_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["--replay", str(tmp_path / "no"), "--report", str(tmp_path / "no folder" / "r.html")])
    lines = capsys.readouterr().err.strip().splitlines()
    assert status == 1 and len(lines) == 1 and "no folder" in lines[0]  # before anything is analysed
    assert main(["--report", "x.html"]) == 2
    assert main(["--replay", "x", "--report", "x.html", "--jobs", "2"]) == 2


def test_the_report_as_pdf_has_pages_and_figures(qapp: object, tmp_path: Path) -> None:
    html = report_of([shot()])
    write_pdf(html, tmp_path / "report.pdf")
    written = (tmp_path / "report.pdf").read_bytes()
    assert written.startswith(b"%PDF") and written.count(b"/Image") >= html.count("<svg")
    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]


def test_the_plots_on_paper_are_curves_and_no_black_boxes(qapp: object, tmp_path: Path) -> None:
    """Drawn without the page's style sheet each path was filled with black."""
    write_pdf(report_of([shot()]), tmp_path / "report.pdf")
    document = pypdfium2.PdfDocument(tmp_path / "report.pdf")
    pages = [
        document[n].render(scale=1.5, rev_byteorder=True).to_numpy()[..., :3].astype(int) for n in range(len(document))
    ]
    document.close()
    wanted = {"simulated": (0xF0, 0x80, 0x3C), "residual": (0x1B, 0x5F, 0xA8), "band": (0xD5, 0xDD, 0xE8)}
    for kind, colour in wanted.items():
        near = [np.count_nonzero(np.abs(page - colour).max(axis=2) < 24) for page in pages]
        assert max(near) > 300, (kind, near)
    for page in pages:
        black = page.max(axis=2) < 40
        assert black.mean() < 0.05  # text
        # no box: nowhere is a square of 12 points a side black all over
        squares = black[: black.shape[0] // 18 * 18, : black.shape[1] // 18 * 18].reshape(
            black.shape[0] // 18, 18, -1, 18
        )
        assert not squares.all(axis=(1, 3)).any()


def test_a_figure_alone_has_the_colours_that_the_sheet_gives_it() -> None:
    rules = figure_rules()
    assert ".simulated { stroke: #f0803c; stroke-width: 3.6; }" in rules and "var(" not in rules
    kinds = {found for found in re.findall(r'class="([\w-]+)"', "".join(map(str, figures(shot()))))}
    assert all(f".{kind} {{" in rules for kind in kinds - {"key"})


def test_a_figure_bears_its_title_and_says_what_it_shows() -> None:
    captions = [re.findall(r"<b>([^.]+[.])</b> ([^<]+[.]) <", str(figure))[0] for figure in figures(shot())]
    titles = ["The shot.", "Residual.", "First contact.", "Force against deflection.", "Gap."]
    assert [title for title, _ in captions] == titles
    for (_, words), said in zip(
        captions, ("over the whole shot", "noise", "Bounces", "slope", "Distance"), strict=True
    ):
        assert said in words


def test_a_unit_ends_no_line_after_its_newton():
    page = tag_table(["number", "N s/m"], [["\u03b3_N (N s/m)", "0.4 N s/m", "12 N soft"]])
    assert page.count("N\u00a0s/m") == 3 and "N s/m" not in page


def _rows(markup: Markup) -> dict[str, str]:
    """Return the cell of each row of a table by the row's heading."""
    return dict(re.findall(r"<tr><th[^>]*>(.*?)</th><td>(.*?)</td></tr>", str(markup)))


def test_the_rig_is_told_in_its_usual_units():
    """Whoever repeats the analysis types these numbers."""
    rig = Setup(
        17.85e-3,
        2e-6,
        wavelength_vacuum_m=632.991354e-9,
        wavelength_air_m=632.8206e-9,
        air=Air(21.5, 1.0132e5, 45.0),
        rest_frequency_hz=2.73e6,
        plate=Plate(12e-3, 2e-3, 0.3e-3, 10e-3, 8510.0, 131e9),
        digitizer_bits=12,
        extra={"operator": "me"},
    )
    said = _rows(taken_with(replace(shot("one"), setup=rig)))
    assert said["moving mass"] == "17.85 g, u = 0.002 g"
    assert said["wavelength in vacuum"] == "632.991354 nm"
    assert said["wavelength in air, as given"] == "632.820600 nm"
    assert said["air"] == "21.5 °C, 101320 Pa, 45 % humidity"
    assert said["rest frequency, as given"] == "2730000 Hz"
    assert "arm length m 0.012" in said["plate"] and said["digitizer"] == "12 bits" and said["operator"] == "me"
    assert said["sample rate"] == "30000000 samples/s" and said["samples per channel"] == "5000000"
    assert said["light switch"] == "20 ms after the first sample"
    bare = _rows(taken_with(replace(shot("one"), setup=Setup(17.85e-3))))
    assert bare["wavelength in air"].startswith("not given: 632.8 nm")
    assert "air" not in bare and "plate" not in bare and "rest frequency, as given" not in bare
