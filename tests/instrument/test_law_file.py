"""A law as a file: what is read, and the one line for an error."""

from pathlib import Path

import pytest

from instrument.files.law_file import read_law
from instrument.files.recording_error import RecordingError

DOCUMENTED = Path(__file__).resolve().parents[2] / "docs" / "own-laws.md"


def test_the_documented_law_is_read(tmp_path: Path) -> None:
    text = DOCUMENTED.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
    (tmp_path / "stir.toml").write_text("\n".join(line[3:] for line in text.splitlines()), encoding="utf-8")
    law = read_law(tmp_path / "stir.toml")
    assert (law.name, law.where, law.formula.text) == ("stir", "block", "-c * v**3")
    assert law.parameters[0].lower == 0


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("name = 3", "name: missing, or not a text"),
        ('name = "a"\nwhere = "block"\nformula = "q*c"\n[parameters.c]\nunit = ""\nstart = 1', "column 1: no 'q'"),
        ("name = ", "not TOML"),
    ],
)
def test_what_is_no_law_is_one_line_with_the_file(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=why) as refused:
        read_law(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_a_law_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        read_law(tmp_path / "none.toml")
