"""A few hundred damaged files; ten thousand and more: python -m tests.benchmarks.fuzz."""

from pathlib import Path

from analysis.shot.recording import Recording
from tests.instrument.fuzzing import fuzz


def test_spoilt_files_open_or_are_refused_in_one_line(shot: Recording, tmp_path: Path) -> None:
    happened = fuzz(tmp_path, shot, 600, seed=5)
    assert sum(happened.values()) == 600
    assert happened["metadata refused in one line"] > 50 and happened["metadata opened"] > 10
    assert {path.name for path in tmp_path.iterdir()} == {
        "s.sigmf-meta", "s.sigmf-data", "m.csv", "m.toml", "good.json",
    }  # fmt: skip
