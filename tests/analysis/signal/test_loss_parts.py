"""The parts of the search for lost samples: phases of blocks, what is suspicious, how many samples a jump is."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.signal.losses import (
    STEP_SAMPLES,
    _block_phases,
    _jumps,
    _likely_loss,
    _losses_near,
    _merge_clusters,
    _moving_jump,
    _side_phase,
    _wrapped,
    has_phase_jumps,
    phase_jump_samples,
)

TURNS = 0.273


def _track(cycles: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(phase_cycles=cycles)


@pytest.mark.parametrize(("jump", "found"), [(0.0, False), (0.009, False), (0.012, True), (-0.3, True), (1.0, False)])
def test_a_rest_beat_is_suspicious_from_a_hundredth_of_a_cycle(jump: float, found: bool) -> None:
    cycles = 0.2 * np.arange(2000)
    cycles[1000:] += jump
    assert has_phase_jumps(_track(cycles)) == found  # type: ignore[arg-type]
    cycles[10:40] = np.nan
    assert has_phase_jumps(_track(cycles)) == found  # type: ignore[arg-type]
    assert not has_phase_jumps(_track(cycles[950:1050]))  # type: ignore[arg-type]  # too short to tell


@pytest.mark.parametrize(("jump", "found"), [(0.03, False), (0.06, True)])
def test_in_noise_a_jump_must_be_eight_times_the_usual(jump: float, found: bool) -> None:
    cycles = np.random.default_rng(3).normal(0.0, 0.004, 4000)  # steps over 16 samples scatter by 0.0057
    cycles[2000:] += jump
    assert has_phase_jumps(_track(cycles)) == found  # type: ignore[arg-type]


def test_kinks_are_told_at_their_place_once_each() -> None:
    n = np.arange(3000)
    cycles = 3e-5 * n**2
    for at, size in ((500, 0.02), (1200, -0.3), (1200 + 3 * STEP_SAMPLES, 0.4), (2500, 0.002)):
        cycles[at:] += size
    places = phase_jump_samples(_track(cycles))  # type: ignore[arg-type]
    assert len(places) == 3 and np.abs(np.array(places) - [500, 1200, 1200 + 3 * STEP_SAMPLES]).max() <= 2
    assert phase_jump_samples(_track(3e-5 * n**2)) == [] == phase_jump_samples(_track(cycles[:100]))  # type: ignore[arg-type]
    cycles[800:820] = np.nan  # a gap is known, and no kink
    assert len(phase_jump_samples(_track(cycles))) == 3  # type: ignore[arg-type]


def test_block_phases_are_those_of_a_windowed_sum_and_of_the_true_beat() -> None:
    block, n = 64, np.arange(64 * 20)
    values = 5.0 * np.cos(2 * np.pi * (TURNS * n + 0.1))
    phase, size = _block_phases(values, TURNS, block)
    assert phase.size == size.size == 39
    window = np.hanning(block + 1)[:-1]
    for k in (0, 7, 38):
        begin = 32 * k
        z = np.sum(window * values[begin : begin + block] * np.exp(-2j * np.pi * TURNS * (begin + np.arange(block))))
        assert _wrapped(phase[k] - np.angle(z) / (2 * np.pi)) == pytest.approx(0.0, abs=1e-12)
        assert size[k] == pytest.approx(2 * abs(z) / window.sum())
    assert phase == pytest.approx(0.1, abs=2e-3) and size == pytest.approx(5.0, rel=2e-3)


def test_jumps_of_a_phase_are_found_at_their_sample_and_the_frequency_beside_them() -> None:
    n = np.arange(40_000)
    turned = (TURNS + 2e-6) * n
    turned[10_000:] += 0.3
    turned[25_001:] -= 0.02
    values = np.rint(900 * np.cos(2 * np.pi * turned) + 40).astype(np.int16)
    turns, places = _jumps(values, TURNS, 64)
    assert turns == pytest.approx(TURNS + 2e-6, abs=2e-8)
    assert len(places) == 2 and np.abs(np.array(places) - [10_000, 25_001]).max() <= 48
    assert _jumps(np.rint(900 * np.cos(2 * np.pi * TURNS * n)).astype(np.int16), TURNS, 64)[1] == []


def test_places_close_together_are_one() -> None:
    assert _merge_clusters([]) == [] and _merge_clusters([5]) == [5]
    assert _merge_clusters([100, 292, 293, 1000, 1150]) == [196, 293, 1075]  # within 192 samples of the first


@pytest.mark.parametrize("lost", [1, 2, 7, 33, 64, 128, 256, 1024, 8192])
def test_a_loss_is_the_number_that_explains_the_jumps_of_both_beats(lost: int) -> None:
    moved = 0.3131
    jumps = float(_wrapped(np.array(lost * TURNS + 5e-4))), float(_wrapped(np.array(lost * moved - 5e-3)))
    found = _likely_loss(77, TURNS, jumps[0], 0.0, (moved, jumps[1]))
    assert found is not None and (found.sample_start, found.samples_lost) == (77, lost)


def test_no_number_explains_jumps_that_disagree_and_few_are_likelier_than_many() -> None:
    assert _likely_loss(0, 0.25, 0.11, 0.0, None) is None  # 0, a quarter, half or three quarters
    alone = _likely_loss(0, 0.25, 0.25, 0.0, None)
    assert alone is not None and alone.samples_lost == 1  # and not 5, 9, ...
    assert _likely_loss(0, 0.25, 0.25, 0.0, (0.25, 0.1)) is None
    five = _likely_loss(0, 0.25, 0.25, 0.0, (0.1, 0.5))
    assert five is not None and five.samples_lost == 5
    wide = _likely_loss(0, 0.25, 0.29, 0.02, None)  # within the noise of the jump
    assert wide is not None and wide.samples_lost == 1


def test_a_moving_beat_is_extrapolated_as_a_parabola_of_its_cycles() -> None:
    n = np.arange(4096)
    cycles = np.polynomial.Polynomial([0.21, 0.31, -2e-6])  # of samples from 2048
    x = 700.0 * np.cos(2 * np.pi * cycles(n - 2048.0))
    for side in (slice(0, 1900), slice(2200, 4096)):
        found = _side_phase(x, side, 2048)
        assert found is not None
        assert float(_wrapped(np.array(found(0.0) - 0.21))) == pytest.approx(0.0, abs=3e-3)
        assert found.deriv()(0.0) == pytest.approx(0.31, abs=2e-5) and found.deriv(2)(0.0) == pytest.approx(
            -4e-6, rel=0.1
        )
    assert _side_phase(x, slice(0, 255), 2048) is None
    dark = x.copy()
    dark[500:800] = 0.0
    assert _side_phase(dark, slice(0, 1900), 2048) is None


@pytest.mark.parametrize("lost", [0, 3, 40])
def test_a_moving_beat_jumps_by_the_samples_that_are_missing(lost: int) -> None:
    n = np.arange(4096 + lost)
    whole = 700.0 * np.cos(2 * np.pi * (0.3131 * n + 1e-6 * (n - 2048.0) ** 2))
    x = np.delete(whole, np.arange(2048, 2048 + lost))
    found = _moving_jump(x, 2048)
    assert found is not None
    turns, jump = found
    assert turns == pytest.approx(0.3131 + 1e-6 * lost, abs=5e-6)
    assert float(_wrapped(np.array(jump - lost * turns))) == pytest.approx(0.0, abs=5e-3)
    x[2048:2078] = 0.0  # what lies between the two sides is left out
    again = _moving_jump(x, 2048, 30)
    assert again is not None and again[1] == pytest.approx(jump, abs=5e-3)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("samples", "found"), [(63, False), (64, True), (400, True)])
def test_a_loss_is_examined_with_64_samples_on_either_side(samples: int, found: bool, turned: bool) -> None:
    """Half of the shorter side is doubtful, 32 samples at least; the rest tells the phase of the beat."""
    n = np.arange(1000)
    n = np.where(n < (1000 - samples if turned else samples), n, n + 3)
    rest, moving = (np.rint(900 * np.cos(2 * np.pi * turns * n)).astype(np.int16) for turns in (TURNS, 0.3131))
    at = 1000 - samples if turned else samples
    gaps = _losses_near(rest, moving, at, TURNS)
    assert [(gap.sample_start, gap.samples_lost) for gap in gaps] == ([(at, 3)] if found else [])
