"""``levimass paper`` without a screen: the table, the result file, the figures, and clear failures."""

import json
import os
from pathlib import Path

import pytest
from PySide6.QtGui import QImage

from app.command_line import figures
from app.command_line.paper import paper, table


def test_table_and_result(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert paper(str(tmp_path / "paper.json"), None, None) == 0
    text = capsys.readouterr().out
    written = json.loads((tmp_path / "paper.json").read_text(encoding="utf-8"))
    assert written["schema"] == "levimass.paper/1" and written["recording"] is None
    for row in written["rows"]:
        assert row["what"] in text
    assert len(written["open"]) == text.count("  unresolved: ") == 4
    assert "0.2617023" in text and "0.2618907" in text and "recording" not in text.splitlines()[4]
    assert "{" not in text


def test_result_on_standard_output_is_json_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert paper("-", None, None) == 0
    assert json.loads(capsys.readouterr().out)["rows"]


def test_a_recording_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert paper(None, None, tmp_path / "nothing.sigmf-meta") == 1
    streams = capsys.readouterr()
    assert "nothing" in streams.err and "Traceback" not in streams.err
    assert "k_p, disc rigid" in streams.out  # the paper itself is reproduced all the same


def test_figures_show_something(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert paper("-", tmp_path / "figures", None) == 0
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"figure-{n}.{ending}" for n in (4, 5, 6, 7) for ending in ("png", "svg")}
    for number in (4, 5, 6, 7):
        image = QImage(str(tmp_path / "figures" / f"figure-{number}.png"))
        assert image.width() == 2000
        columns = [sum(_reddish(image, x, y) for y in range(0, image.height(), 4)) for x in range(0, 2000, 10)]
        assert sum(columns[:100]) == 0 and sum(columns[100:]) > 50  # simulated on the right, nothing on the left
        assert "<svg" in (tmp_path / "figures" / f"figure-{number}.svg").read_text(encoding="utf-8")
    assert "simulation alone" in capsys.readouterr().err


@pytest.mark.parametrize(("given", "used"), [(None, "offscreen"), ("", "offscreen"), ("minimal", "minimal")])
def test_figures_need_no_screen(
    given: str | None,
    used: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Where no platform is chosen Qt would look for a display, and end the program where there is none."""
    chosen = []

    def write_figures(_shot: object, folder: Path) -> list[Path]:
        chosen.append(os.environ.get("QT_QPA_PLATFORM"))
        return [folder / "figure-4.png"]

    monkeypatch.setattr(figures, "write_figures", write_figures)
    monkeypatch.setenv("QT_QPA_PLATFORM", given or "")
    if given is None:
        monkeypatch.delenv("QT_QPA_PLATFORM")
    paper(None, tmp_path, None)
    assert chosen == [used]
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "figure-4.png")


def test_figures_to_a_place_that_cannot_be(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert paper("-", tmp_path / "file" / "figures", None) == 1
    assert "file" in capsys.readouterr().err


def test_a_result_to_a_place_that_cannot_be(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert paper(str(tmp_path / "none" / "p.json"), None, None) == 1
    assert "p.json" in capsys.readouterr().err


def test_the_recording_beside_the_paper(recordings: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert paper(str(tmp_path / "p.json"), tmp_path, recordings / "paper") == 0
    rows = {row["key"]: row for row in json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))["rows"]}
    for key, close in (("velocity_out", 1e-5), ("cor_quasi_static", 1e-5), ("slope", 2e-3), ("deflection", 2e-3)):
        row = rows[key]
        assert row["recorded"]["value"] == pytest.approx(row["simulated"], rel=close), key
    assert rows["input.plate_stiffness_n_per_m"]["recorded"]["value"] == pytest.approx(221.4, rel=1e-3)
    image = QImage(str(tmp_path / "figure-6.png"))
    dark = sum(_dark(image, x, y) for x in range(160, 980, 10) for y in range(120, 700, 2))
    assert dark > 20


def _reddish(image: QImage, x: int, y: int) -> bool:
    colour = image.pixelColor(x, y)
    return colour.red() > 180 and colour.green() < 130 and colour.blue() < 110


def _dark(image: QImage, x: int, y: int) -> bool:
    colour = image.pixelColor(x, y)
    return colour.red() < 80 and colour.blue() < 100


def test_table_lines_stay_readable() -> None:
    from analysis.paper.paper import reproduce

    assert max(len(line) for line in table(reproduce()).splitlines()) <= 150
