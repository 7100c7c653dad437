from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.recording import Role
from analysis.shot.shot import AnalysisError
from analysis.signal.stream import LiveChunk, LiveDemodulator
from tests.analysis.signal.beats import collision, free_flight, make_recording


def _run(live: LiveDemodulator, counts: np.ndarray, block: int) -> list[LiveChunk]:
    return [live.feed(counts[a : a + block]) for a in range(0, counts.shape[0], block)]


def _joined(chunks: list[LiveChunk], name: str) -> np.ndarray:
    return np.concatenate([getattr(c, name) for c in chunks])


def test_the_live_signals_follow_an_impact_and_do_not_depend_on_the_blocks() -> None:
    truth = collision(0.265, 25e-3)
    recording = make_recording(truth, 500_000)
    runs = [
        _run(LiveDemodulator(10e6, 1, 0, recording.setup, 10e3, 2e3), recording.counts, block)
        for block in (4096, 30_011)
    ]
    time, velocity, force = (_joined(runs[0], n) for n in ("time_s", "velocity_m_per_s", "force_n"))
    exact = (truth(time + 1e-6) - truth(time - 1e-6)) / 2e-6
    assert np.max(np.abs(velocity - exact)) < 2e-3  # the corner where the force sets in, through 2 kHz
    assert np.median(np.abs(velocity - exact)) < 2e-6
    assert force.max() == pytest.approx(0.01785 * 0.265 * np.pi / 10e-3, rel=0.02)
    assert np.array_equal(_joined(runs[0], "beat_frequency_hz"), _joined(runs[1], "beat_frequency_hz"))
    assert runs[0][-1].rest_frequency_hz == pytest.approx(2.73e6, abs=0.05)


def test_a_rest_beat_that_changes_is_followed_though_it_is_read_a_quarter_of_the_time() -> None:
    rate, setup = 2e6, replace(make_recording(free_flight(0.1), 10).setup, rest_frequency_hz=None)
    time_s = np.arange(round(1.2 * rate)) / rate
    turns = np.where(time_s < 0.35, 0.4e6 * time_s, 0.4e6 * 0.35 + 0.40002e6 * (time_s - 0.35))
    counts = np.rint(1000 * np.sin(2 * np.pi * turns))[:, None].repeat(2, axis=1).astype(np.int16)
    chunks = _run(LiveDemodulator(rate, 1, 0, setup), counts, 40_000)
    before, after = chunks[16].rest_frequency_hz, chunks[-1].rest_frequency_hz
    assert before == pytest.approx(0.4e6, abs=0.02)
    assert after == pytest.approx(0.40002e6, abs=2.5)  # 0.85 s later, with a memory of 0.2 to 0.3 s
    assert _joined(chunks, "velocity_m_per_s")[2000:3000] == pytest.approx(0.0, abs=1e-8)


def test_pd0_is_read_a_quarter_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    rate = 2e6
    turns = 0.4e6 * np.arange(round(0.5 * rate)) / rate
    counts = np.rint(1000 * np.sin(2 * np.pi * turns))[:, None].repeat(2, axis=1).astype(np.int16)
    live = LiveDemodulator(rate, 1, 0, replace(make_recording(free_flight(0.1), 10).setup, rest_frequency_hz=None))
    read: list[int] = []
    average = live._average_rest
    monkeypatch.setattr(live, "_average_rest", lambda rest: read.append(rest.size) or average(rest))  # type: ignore[func-returns-value]
    shown = len(_joined(_run(live, counts, 7_000), "time_s"))
    assert 0.15 * shown < sum(read) < 0.3 * shown


def test_a_gap_separates_the_live_signals_and_is_counted_in_time() -> None:
    recording = make_recording(free_flight(-0.3), 400_000)
    live = LiveDemodulator(10e6, 1, 0, recording.setup)
    chunks = _run(live, recording.counts[:200_000], 20_000)
    live.gap(37_123)
    chunks += _run(live, recording.counts[237_123:], 20_000)
    velocity = _joined(chunks, "velocity_m_per_s")
    assert np.isnan(velocity).sum() == 1
    assert np.allclose(velocity[~np.isnan(velocity)], -0.3, atol=2e-5)
    assert _joined(chunks, "time_s")[-1] == pytest.approx(0.04, abs=6e-3)
    assert np.all(np.diff(_joined(chunks, "time_s")) > 0)


def test_a_gap_of_unknown_length_separates_the_signals_and_takes_no_time() -> None:
    recording = make_recording(free_flight(-0.3), 400_000)
    live = LiveDemodulator(10e6, 1, 0, recording.setup)
    chunks = _run(live, recording.counts[:200_000], 20_000)
    assert live.rate_hz == pytest.approx(10e3, rel=0.05)  # where nothing else is asked for
    live.gap(None)
    chunks += _run(live, recording.counts[237_123:], 20_000)
    time_s, velocity = _joined(chunks, "time_s"), _joined(chunks, "velocity_m_per_s")
    assert np.isnan(velocity).sum() == 1 and np.all(np.diff(time_s) > 0)
    assert time_s[-1] == pytest.approx(0.04 - 37_123 / 10e6, abs=6e-3)


def test_it_waits_for_light_and_states_so() -> None:
    recording = make_recording(free_flight(0.1), 200_000)
    live = LiveDemodulator(10e6, 1, 0, recording.setup)
    dark = np.random.default_rng(3).normal(0, 5, (60_000, 2)).astype(np.int16)
    assert all(c.time_s.size == 0 and c.problem for c in _run(live, dark, 10_000))
    lit = _run(live, recording.counts, 10_000)
    assert np.allclose(lit[-1].velocity_m_per_s, 0.1, atol=2e-5)
    assert lit[-1].problem is None


def test_memory_does_not_grow() -> None:
    recording = make_recording(free_flight(0.1), 100_000)
    live = LiveDemodulator(10e6, 1, 0, recording.setup)
    _run(live, recording.counts, 50_000)
    sizes = []
    for _ in range(6):
        _run(live, recording.counts, 50_000)
        sizes.append(sum(line._phase.nbytes + line._reader._phase.nbytes for line in live._beats))
    assert max(sizes) < 1.05 * sizes[0]


def test_a_stated_rest_frequency_replaces_the_reference() -> None:
    recording = make_recording(free_flight(0.1), 200_000, order=(Role.MEASUREMENT,))
    chunks = _run(LiveDemodulator(10e6, 0, None, recording.setup), recording.counts, 10_000)
    assert np.allclose(_joined(chunks, "velocity_m_per_s"), 0.1, atol=2e-5)
    with pytest.raises(AnalysisError, match="rest frequency"):
        LiveDemodulator(10e6, 0, None, make_recording(free_flight(0.1), 10).setup)


def test_what_comes_before_the_rest_frequency_is_known_keeps_its_order() -> None:
    """Blocks of a tenth of a millisecond: the moving beat waits for the first frequency of the other one."""
    recording = make_recording(free_flight(-0.3), 200_000)
    chunks = _run(LiveDemodulator(10e6, 1, 0, recording.setup), recording.counts, 1000)
    first = next(chunk for chunk in chunks if chunk.time_s.size)
    assert first.time_s.size > 1  # what waited comes with it
    assert np.all(np.diff(_joined(chunks, "time_s")) > 0)


@pytest.mark.parametrize("rest_hz", [0.6e6, 2.73e6, 4.4e6])
def test_a_beat_is_shown_with_its_frequency_up_to_its_farthest_doppler_shift(rest_hz: float) -> None:
    """1.3 MHz, or three quarters of the way from the rest beat to zero or to half the sample rate."""
    reach = min(1.3e6, 0.75 * rest_hz, 0.75 * (5e6 - rest_hz))
    for share in (-0.9, 0.9):
        speed = share * reach * 0.5 * 632.8e-9  # a beat below the rest beat where the block goes away
        recording = make_recording(free_flight(speed), 300_000, rest_hz=rest_hz)
        still = make_recording(free_flight(0.0), 60_000, rest_hz=rest_hz)
        live = LiveDemodulator(10e6, 1, 0, recording.setup)
        _run(live, still.counts, 20_000)
        last = _run(live, recording.counts, 50_000)[-1]
        assert last.beat_frequency_hz[-20:] == pytest.approx(rest_hz - share * reach, abs=50.0)
        assert last.velocity_m_per_s[-20:] == pytest.approx(speed, abs=2e-5)
        assert np.abs(last.force_n[-20:]).max() < 2e-3
