"""A source that stops: the message says whether samples came before, and what the light switch did."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from instrument.capture.acquisition import State
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import Block
from tests.instrument.capturing import SETTINGS, Capturing, until
from tests.instrument.fake_digitizer import FakeDigitizer


class Fading(FakeDigitizer):
    """Sends so many samples, its light switch moving by a fraction of what it should; then nothing, or the end."""

    def __init__(self, samples: int, ends: bool = False) -> None:
        super().__init__()
        self._samples, self._ends = samples, ends

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        if self.at >= self._samples:
            return Block(0, ended=self._ends)
        block = super().read_into(buffer, timeout_s)
        buffer[: block.samples, 2] = 100 + (buffer[: block.samples, 2] - 100) // 10
        return block


@pytest.mark.parametrize(
    ("samples", "ends", "low_v", "words"),
    [
        (0, False, None, "no samples came for 0.2 s"),
        (
            90_000,
            False,
            None,
            "none for 0.2 s; the light switch moved by 150 counts, a step takes 205",
        ),
        (90_000, False, 0.5, "samples came, then none for 0.2 s; the light switch never crossed its thresholds"),
        (90_000, True, None, "before the light switch fired: the light switch moved by 150 counts, a step takes 205"),
    ],
)
def test_a_source_that_stops_says_what_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, samples: int, ends: bool, low_v: float | None, words: str
) -> None:
    monkeypatch.setattr("instrument.capture.stream_reader.STALL_S", 0.2)
    high_v = None if low_v is None else low_v + 0.5
    options = CaptureOptions(tmp_path, SETTINGS, switch_low_v=low_v, switch_high_v=high_v)
    rig = Capturing(tmp_path, Fading(samples, ends), live=False, options=options)
    rig.capture.arm()  # before the start: else the stream, which is watched, may stop unarmed
    with rig:
        now = until(rig.capture, lambda s: s.state is State.FAULT)
        assert words in now.message and "check" in now.remedy
