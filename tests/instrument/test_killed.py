"""A capture that is killed: complete shots are whole, the last one opens as far as it got, settings are intact."""

import random
from pathlib import Path

from tests.instrument.killing import kill_once


def test_killed_at_a_few_random_moments(tmp_path: Path) -> None:
    moment = random.Random(11)
    complete = 0
    for number in range(2):  # a hundred of them: python -m tests.benchmarks.kill
        folder = tmp_path / str(number)
        folder.mkdir()
        complete += kill_once(folder, moment)["complete"]
    assert complete >= 2
