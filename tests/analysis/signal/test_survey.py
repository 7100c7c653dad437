"""A survey of a beat: what was put in, and each gate's two sides."""

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError
from analysis.signal.survey import STRETCH_S, survey

RATE = 10e6


def _counts(
    frequency_hz: float = 2.73e6, amplitude: float = 800.0, noise: float = 10.0, samples: int = 200_000
) -> np.ndarray:
    n = np.arange(samples)
    beat = amplitude * np.cos(2 * np.pi * frequency_hz / RATE * n + 0.3)
    return np.rint(beat + 37.0 + np.random.default_rng(5).normal(0.0, noise, samples)).astype(np.int16)


@pytest.mark.parametrize("frequency_hz", [0.41e6, 1.234567e6, 2.73e6, 4.6e6])
@pytest.mark.parametrize("noise", [3.0, 60.0])
def test_amplitude_frequency_offset_and_noise_are_those_of_the_beat(frequency_hz: float, noise: float) -> None:
    found = survey(_counts(frequency_hz, noise=noise), RATE, 12, "PD1")
    assert found.amplitude_counts == pytest.approx(800.0, rel=0.01) and found.offset_counts == pytest.approx(
        37.0, abs=2.0
    )
    assert found.seen.all() and found.clipped_fraction == 0.0
    assert found.frequency_hz == pytest.approx(frequency_hz, abs=0.1 * RATE / found.stretch)
    assert found.snr_db == pytest.approx(10 * np.log10(800.0**2 / 2 / (noise**2 + 1 / 12)), abs=0.7)
    assert (found.low_hz, found.high_hz) == (found.frequency_hz.min(), found.frequency_hz.max())


@pytest.mark.parametrize(
    ("rate_hz", "samples", "stretch", "stretches"),
    [
        (10e6, 200_000, 512, 40),  # 400 samples are 40 us: the nearest power of two
        (1e6, 200_000, 256, 200),  # never fewer than 256
        (1e9, 4_000_000, 4096, 40),  # nor more than 4096
        (10e6, 30_000_000, 512, 2000),
        (10e6, 5_200, 512, 10),  # no more than fit beside each other
        (10e6, 512, 512, 1),
    ],
)
def test_stretches_of_40_us_a_millisecond_apart(rate_hz: float, samples: int, stretch: int, stretches: int) -> None:
    period = 4 * np.arange(samples, dtype=np.int64) % 15
    found = survey((200 * (period - 7)).astype(np.int16), rate_hz, 12, "PD1")
    assert (found.stretch, found.sample.size) == (stretch, stretches)
    assert found.sample[0] == 0 and (stretches == 1 or found.sample[-1] == samples - stretch)
    assert pytest.approx(40e-6) == STRETCH_S


@pytest.mark.parametrize(("dark", "seen"), [(0.5, True), (0.79, True), (0.85, False)])
def test_a_beat_must_be_seen_in_a_fifth_of_the_record(dark: float, seen: bool) -> None:
    counts = _counts()
    counts[: int(dark * counts.size)] = _counts(amplitude=0.0)[: int(dark * counts.size)]
    if not seen:
        with pytest.raises(AnalysisError, match="PD1: no beat found, only noise"):
            survey(counts, RATE, 12, "PD1")
        return
    found = survey(counts, RATE, 12, "PD1")
    lit = found.sample >= dark * counts.size
    assert not found.seen[found.sample + found.stretch < dark * counts.size].any()
    assert found.seen[lit].all() and found.amplitude_counts == pytest.approx(800.0, rel=0.02)
    assert found.low_hz > 2.7e6  # of what was seen


@pytest.mark.parametrize(("share", "kept"), [(0.2, True), (0.1, False)])
def test_a_flicker_below_a_seventh_of_the_usual_height_is_no_beat(share: float, kept: bool) -> None:
    """A fiftieth of its power; rounding alone has peaks as high."""
    counts = _counts(noise=0.3).astype(float)
    half = counts.size // 2
    counts[half:] *= share
    found = survey(np.rint(counts).astype(np.int16), RATE, 12, "PD1")
    late = found.sample > half
    assert found.seen[~late].all() and found.seen[late].all() == kept == found.seen[late].any()


def test_a_channel_without_a_beat_is_refused_with_its_name() -> None:
    for counts, words in (
        (np.full(20_000, 7, np.int16), "PD0: the channel is flat at 7 counts"),
        ((np.arange(20_000) % 2).astype(np.int16), "PD0: the channel is flat at 0 counts"),
        (_counts(amplitude=0.0), "PD0: no beat found"),
        (_counts(samples=511), "PD0: 511 samples are too short to find a beat in"),
        (np.where(np.arange(20_000) // 3 % 2, 2047, -2048).astype(np.int16), "PD0: saturated: 100 % of the samples"),
    ):
        with pytest.raises(AnalysisError, match=words):
            survey(counts, RATE, 12, "PD0")


@pytest.mark.parametrize(("cut", "clipped"), [(700.0, True), (None, False)])
def test_clipping_below_the_rail_is_seen_by_how_often_the_extremes_come(cut: float | None, clipped: bool) -> None:
    counts = _counts(noise=0.4, amplitude=800.0)
    whole = survey(counts, RATE, 12, "PD1")
    assert whole.clipped_fraction == 0.0
    if cut is not None:
        limited = np.clip(counts, 37 - int(cut), 37 + int(cut)).astype(np.int16)
        share = np.mean(np.abs(limited.astype(int) - 37) == int(cut))
        assert survey(limited, RATE, 12, "PD1").clipped_fraction == pytest.approx(share, rel=0.05) and share > 0.2


@pytest.mark.parametrize(("order", "share"), [(2, 0.05), (3, 0.02), (2, 0.3)])
def test_harmonics_are_told_relative_to_the_beat_also_where_they_fold_back(order: int, share: float) -> None:
    n = np.arange(200_000)
    for frequency in (1.13e6, 2.11e6):  # the harmonics of the second fold back at half the rate
        turn = 2 * np.pi * frequency / RATE * n
        counts = np.rint(8000 * (np.cos(turn) + share * np.cos(order * turn))).astype(np.int16)
        assert survey(counts, RATE, 16, "PD1").harmonics == pytest.approx(share, rel=0.12)
    clean = survey(np.rint(8000 * np.cos(2 * np.pi * 1.13e6 / RATE * n)).astype(np.int16), RATE, 16, "PD1")
    assert clean.harmonics < 1e-3
