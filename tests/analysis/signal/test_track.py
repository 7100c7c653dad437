"""The motion's grid over stored samples and losses, and beats read onto it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Gap, Recording
from analysis.shot.shot import AnalysisError, Cancelled
from analysis.signal import track
from analysis.signal.survey import survey
from analysis.signal.track import BeatSpec, Grid, Track, read_tracks
from analysis.signal.tuning import BATCH, PHASE_STEPS, OscillatorSchedule, fixed_schedule, tune
from tests.analysis.signal.beats import WAVELENGTH_M, free_flight, make_recording

PLAIN = make_recording(free_flight(-0.2), 60_000)
TUNING = tune(10e6, 2.7e6, 2.8e6, 150e3, 450e3, 100)
MOVING = tune(10e6, 3.3e6, 3.5e6, 150e3, 450e3, 100)


@pytest.mark.parametrize(
    ("gaps", "pieces", "samples"),
    [
        ((), ((0, 60_000, 0),), 600),
        ((Gap(20_000, 150),), ((0, 20_000, 0), (20_000, 60_000, 20_150)), 601),
        ((Gap(20_000, 99), Gap(30_000, 2)), ((0, 20_000, 0), (20_000, 30_000, 20_099), (30_000, 60_000, 30_101)), 601),
        ((Gap(20_000, None),), ((20_000, 60_000, 20_000),), 600),
        ((Gap(45_000, None),), ((0, 45_000, 0),), 450),
        ((Gap(10_000, 50), Gap(40_000, None)), ((0, 10_000, 0), (10_000, 40_000, 10_050)), 400),
        ((Gap(15_000, None), Gap(20_000, 300)), ((15_000, 20_000, 15_000), (20_000, 60_000, 20_300)), 603),
    ],
)
def test_a_grid_lies_over_the_longest_part_without_a_loss_of_unknown_length(
    gaps: tuple[Gap, ...], pieces: tuple[Any, ...], samples: int
) -> None:
    grid = Grid.of(replace(PLAIN, gaps=gaps), 100)
    assert (grid.pieces, grid.samples) == (pieces, samples)
    assert grid.rate_hz == pytest.approx(1e5)


def test_sixty_four_motion_samples_are_the_fewest() -> None:
    assert Grid.of(replace(PLAIN, counts=PLAIN.counts[:6400]), 100).samples == 64
    with pytest.raises(AnalysisError, match="6399 samples give 63 of motion"):
        Grid.of(replace(PLAIN, counts=PLAIN.counts[:6399]), 100)


def test_a_motion_sample_is_centred_six_steps_and_half_a_window_after_its_first() -> None:
    grid = Grid.of(replace(PLAIN, gaps=(Gap(20_000, 150),)), 100)
    delay = TUNING.delay_samples
    assert grid.time_s(TUNING)[[0, 10]] == pytest.approx([(600 + delay) / 10e6, (1600 + delay) / 10e6])
    assert grid.time_s(TUNING).size == grid.samples
    assert grid.stored_sample(10, TUNING) == int(1600 + delay)
    lost = int((20_160 - delay) // 100 - 6)
    for place in (lost + 1, lost + 40):  # after the loss, stored 150 samples earlier
        assert grid.stored_sample(place, TUNING) == int((place + 6) * 100 + delay) - 150
    inside = int((20_100 - delay) // 100 - 6)  # in the loss: the last that was stored
    assert grid.stored_sample(inside, TUNING) == 19_999


def test_a_beats_distance_from_its_oscillator_is_told_batch_by_batch() -> None:
    factor = 100 // MOVING.decimation
    grid = Grid.of(PLAIN, 100)
    low, high = MOVING.steps(3.3e6), MOVING.steps(3.5e6)
    centre = (np.arange(599) + 6) * factor + factor // 2
    schedule = OscillatorSchedule(np.array([low, high]), np.array([0, 1, 1, 0], np.int32))
    steps = np.array([low, high])[np.array([0, 1, 1, 0])[np.minimum(centre // BATCH, 3)]]
    spec: Any = SimpleNamespace(tuning=MOVING, schedule=schedule)
    cycles = (3.42e6 - 3.5e6) / 1e5 * np.arange(600)
    empty = np.zeros(0)
    read = Track(cycles, empty, empty, empty > 0, (), 0, 3.5e6, spec)
    oscillator = steps * MOVING.phase_rate_hz / PHASE_STEPS
    assert read.offset_hz(grid) == pytest.approx(3.42e6 - oscillator, abs=1e-3)


def _specs(recording: Recording) -> list[BeatSpec]:
    specs = []
    for column, tuning, hz in ((1, MOVING, 2.73e6 + 0.4 / WAVELENGTH_M), (0, TUNING, 2.73e6)):
        seen = survey(recording.counts[:, column], 10e6, 16, "x")
        specs.append(BeatSpec(tuning, fixed_schedule(tuning, hz), column, seen))
    return specs


def test_both_beats_are_read_onto_the_grid_with_their_noise_height_and_holes() -> None:
    dim = np.where(np.abs(np.arange(60_000) - 30_000) < 500, 0.02, 1.0)
    recording = make_recording(free_flight(-0.2), 60_000, snr_db=30.0, alter=lambda role, t, s: dim * s)
    grid = Grid.of(recording, 100)
    tracks = read_tracks(recording, _specs(recording), grid, None, None)
    for read, hz in zip(tracks, (0.4 / WAVELENGTH_M, 0.0), strict=True):
        time = grid.time_s(read.spec.tuning)
        delayed = time - read.spec.tuning.delay_samples / 10e6
        left = read.phase_cycles + read.oscillator_hz * delayed - (2.73e6 + hz) * time
        known = np.isfinite(left)
        assert known.sum() > 570
        lit = known & ~read.hole
        shift = left[lit] - left[lit].mean()
        assert np.std(shift) == pytest.approx(np.nanmedian(read.std_cycles), rel=0.2)
        assert np.nanmedian(read.amplitude_counts) == pytest.approx(8000.0, rel=0.02)
        dark_s = time[read.hole & known]
        assert dark_s.min() < 2.955e-3 and dark_s.max() > 3.045e-3 and np.ptp(dark_s) < 0.35e-3
        assert np.median(read.amplitude_counts[np.abs(time - 3e-3) < 2e-5]) < 800.0
        assert read.breaks == () and read.doubtful == 0


def test_a_long_loss_breaks_a_track_where_it_ends_and_the_stretches_stay_on_the_grid() -> None:
    lost = 20_000
    stored = np.delete(PLAIN.counts, slice(20_000, 20_000 + lost), axis=0)
    cut = replace(PLAIN, counts=stored, gaps=(Gap(20_000, lost),))
    grid = Grid.of(cut, 100)
    whole, held = (read_tracks(r, _specs(PLAIN), Grid.of(r, 100), None, None)[0] for r in (PLAIN, cut))
    (begins,) = held.breaks
    assert abs(begins - 400) <= 1
    assert grid.samples == 600 == held.phase_cycles.size
    apart = held.phase_cycles - whole.phase_cycles
    known = np.isfinite(apart)
    assert known[:190].sum() > 180 and not known[200:395].any() and known[402:585].all()
    assert apart[known] == pytest.approx(np.rint(apart[known]), abs=1e-6)
    assert held.hole[196:392].all() and not held.hole[:180].any() and not held.hole[405:580].any()


def test_progress_is_told_to_the_end_and_a_beat_that_fails_stops_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(track, "BLOCK_SAMPLES", 10_000)
    grid, told = Grid.of(PLAIN, 100), list[tuple[str, float]]()
    read_tracks(PLAIN, _specs(PLAIN)[:1], grid, lambda what, part: told.append((what, part)), None)
    assert told == [("demodulating", pytest.approx((k + 1) / 6)) for k in range(6)]
    both: list[float] = []
    read_tracks(PLAIN, _specs(PLAIN), grid, lambda what, part: both.append(part), None)
    assert len(both) == 6 and both == sorted(both) and max(both) <= 1.0
    asked: list[int] = []
    with pytest.raises(Cancelled):
        read_tracks(PLAIN, _specs(PLAIN)[:1], grid, None, lambda: asked.append(1) or len(asked) == 3)  # type: ignore[func-returns-value]
    assert len(asked) == 3
    with pytest.raises(AttributeError):
        read_tracks(PLAIN, [_specs(PLAIN)[0], replace(_specs(PLAIN)[1], survey=None)], grid, None, None)  # type: ignore[arg-type]
