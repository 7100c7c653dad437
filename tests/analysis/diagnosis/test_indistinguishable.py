"""A line that only to first order could be what was found: fitted, it is not, and the name stands alone."""

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from tests.bench.blind import records
from tests.benchmarks.loop_cases import Case, as_motion, draw


def _said(name: str, snr: float, seed: int):
    truth = draw(Case("single", (name,), snr, "white", seed), bounded=False).truth
    return diagnose([as_motion(record) for record in records(truth)])


@pytest.mark.slow  # quicker: what a line looks like, and when it is fitted, above and below
def test_a_gradient_of_the_bearing_is_no_line_though_every_shot_alone_could_be_one():
    said = _said("bearing_gradient", 13.0, 43000150)
    (found,) = said.effects
    assert found.evidence["least_separation"] < 5.0  # to first order the line is near: each shot has its own amplitude
    assert found.name == "bearing_gradient" and found.indistinguishable_from == ()


def test_a_line_is_never_given_up_for_what_it_looks_like():
    said = _said("frame_vibration", 13.0, 43000151)
    assert "frame_vibration" in {
        name for one in said.effects for name in (one.name, *(other.name for other in one.indistinguishable_from))
    }
