"""A rest frequency that was stated, against the one PD0 shows."""

from dataclasses import replace

import pytest

from analysis.shot import AnalysisSettings
from analysis.signal.demodulate import demodulate
from tests.analysis.collision import Synthetic
from tests.beats import REST_HZ, recording_of


@pytest.mark.parametrize(("stated", "doubted"), [(REST_HZ, False), (1.011 * REST_HZ, True), (0.5 * REST_HZ, True)])
def test_a_stated_rest_frequency_that_pd0_contradicts_doubts_the_rate(stated: float, doubted: bool) -> None:
    recording = recording_of(Synthetic(duration_s=0.02))
    recording = replace(recording, setup=replace(recording.setup, rest_frequency_hz=stated))
    assert ("rate_doubtful" in demodulate(recording, AnalysisSettings()).flags) is doubted
