"""The real window on a real screen, pressed and read as a person would; the whole session is ``make session``."""

from pathlib import Path

import pytest
from PySide6.QtGui import QImage

from tests.app.virtual_screen import SIZE, play, why_reversed


@pytest.mark.skipif(why_reversed() is not None, reason=str(why_reversed()))
def test_first_start_tour_settings_and_set_up(tmp_path: Path, warm_kernels: None) -> None:
    ended = play(tmp_path, "dark", "brief", timeout_s=300.0)
    if "could not connect to display" in ended.stdout or "xcb" in ended.stdout:
        pytest.skip("Qt's xcb platform lacks a library; the README lists them")
    assert ended.returncode == 0, ended.stdout
    pictures = sorted(tmp_path.glob("*.png"))
    assert [path.stem[3:] for path in pictures] == [
        "first-start", "tour-2", "tour-3", "tour-4", "tour-5", "keys", "settings", "set-up",
    ]  # fmt: skip
    last = QImage(str(pictures[-1]))
    assert (last.width(), last.height()) == SIZE
    assert last.pixelColor(2, 400).lightness() < 60  # dark was chosen in the settings
