"""LARGE: digits up to the first uncertain one, in the largest font that fits the page."""

from dataclasses import replace

import pytest
from PySide6.QtGui import QFontMetricsF

from analysis.shot.quantity import NotSeen, Quantity
from app.window.controls.theme import MARKS, Tone
from app.window.panels.large import COLLISION, DRIVEN, MIN_PX, LargePanel, plain_digits
from tests.app import synthetic
from tests.app.on_screen import large_text


@pytest.mark.parametrize(
    ("reading", "scale", "said"),
    [
        (Quantity(0.987556, 7e-6), 1.0, "0.987556"),
        (Quantity(0.9875562, 2.1e-8), 1.0, "0.987556"),
        (Quantity(-0.2651234567, 1.3e-9), 1.0, "-0.265123"),
        (Quantity(0.0123456789, 1e-9), 1e3, "12.34568"),
        (Quantity(221.42, 0.3), 1.0, "221.4"),
        (Quantity(10003.0, 61.0), 1.0, "10003"),
        (Quantity(1.5e-7, 1e-9), 1.0, "1.5e-7"),
        (NotSeen("dark"), 1.0, "–"),
        (None, 1.0, "–"),
    ],
)
def test_a_number_has_at_most_seven_digits_and_none_beyond_its_uncertainty(reading, scale, said) -> None:
    assert plain_digits(reading, scale) == said


@pytest.fixture
def panel(qtbot):
    one = LargePanel()
    qtbot.addWidget(one)
    one.show()
    return one


@pytest.mark.parametrize("size", [(900, 500), (500, 500), (1600, 300), (300, 900)])
def test_the_font_is_the_largest_that_fits(panel, size) -> None:
    panel.resize(*size)
    panel.show_shot(synthetic.shot(), "a shot")
    font = panel._cells[0][1].font()
    margins, gaps = panel.layout().contentsMargins(), 2 * panel.layout().spacing()
    width = size[0] - margins.left() - margins.right() - gaps
    height = size[1] - margins.top() - margins.bottom()

    def takes(pixels: int) -> tuple[float, float]:
        font.setPixelSize(pixels)
        metrics = QFontMetricsF(font)
        shown = panel._cells[: len(COLLISION)]
        wide = sum(max(metrics.horizontalAdvance(cells[place].text()) for cells in shown) for place in range(3))
        return wide / width, (len(COLLISION) + 1.4) * metrics.height() / height

    pixels = font.pixelSize()
    assert font.bold() and max(takes(pixels)) <= 0.97
    assert max(takes(pixels + 4)) >= 0.92 or pixels == MIN_PX
    assert {cell.font().pixelSize() for cells in panel._cells for cell in cells} == {pixels}
    assert panel._title.font().pixelSize() == pytest.approx(0.5 * pixels, abs=1.5) or pixels < 2 * MIN_PX


def test_a_long_title_is_made_to_fit(panel) -> None:
    panel.resize(900, 500)
    panel.show_shot(synthetic.shot(), "a very long name of a shot " * 4)
    metrics = QFontMetricsF(panel._title.font())
    assert metrics.horizontalAdvance(panel._title.text()) <= 900 or panel._title.font().pixelSize() == MIN_PX


def test_only_a_flag_about_these_numbers_marks_the_title(panel) -> None:
    shot = synthetic.shot()
    for flags, marked in (
        ((), False),
        (("wander",), False),
        (("clipped",), True),
        (("wander", "clipped"), True),
    ):
        panel.show_shot(replace(shot, flags=flags), "a shot")
        assert panel._title.text() == (f"{MARKS[Tone.WARNING]} a shot" if marked else "a shot"), flags
    panel.show_shot(shot, "")
    assert panel._title.text() == "No shot yet"


def test_a_drive_has_its_own_numbers(panel) -> None:
    panel.show_shot(synthetic.driven_shot(), "a drive")
    shown = [cells for cells in panel._cells if cells[0].isVisible()]
    assert [cells[0].text() for cells in shown] == [number.symbol or number.name for number in DRIVEN]
    assert [cells[2].text() for cells in shown] == [number.shown_unit for number in DRIVEN]
    panel.show_shot(synthetic.shot(), "a shot")
    shown = [cells for cells in panel._cells if cells[0].isVisible()]
    assert [cells[0].text() for cells in shown] == [number.symbol or number.name for number in COLLISION]
    assert all(large_text(panel, cells[0].text()) == cells[1].text() != "–" for cells in shown)
    panel.show_shot(None, "")
    assert {cells[1].text() for cells in panel._cells[: len(COLLISION)]} == {"–"}
