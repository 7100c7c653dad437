"""A leak found in the moving beat: its size and phase as they were put in, and what is too little, slow or short."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Gap, Recording, Role
from analysis.signal import phase_errors
from analysis.signal.phase_errors import Leak, find_leak, leak_phase
from analysis.signal.rest import fit_rest_phase
from analysis.signal.survey import survey
from analysis.signal.track import BeatSpec, Grid, read_tracks
from analysis.signal.tuning import fixed_schedule, tune
from tests.analysis.signal.beats import WAVELENGTH_M, free_flight, make_recording

SPEED, REST_HZ, PHASE = 0.2, 2.73e6, 0.3  # cycles
TUNED = tune(10e6, 2.7e6, 2.76e6, 100e3, 450e3, 100), tune(10e6, 3.3e6, 3.4e6, 130e3, 450e3, 100)


def leaking(share: float, seed: int = 1, snr_db: float = 40.0, samples: int = 60_000) -> Recording:
    start = float(np.random.default_rng(seed).uniform(0, 2 * np.pi))

    def alter(role: Role, t: Any, signal: Any) -> Any:
        leak = share * 8000.0 * np.cos(2 * np.pi * (REST_HZ * t + PHASE) + start)
        return signal + leak if role is Role.MEASUREMENT else signal

    return make_recording(free_flight(-SPEED), samples, snr_db=snr_db, seed=seed, alter=alter)


def found_in(recording: Recording, doppler: Any = 2 * SPEED / WAVELENGTH_M, dark: slice = slice(0, 0)) -> Leak | None:
    grid = Grid.of(recording, 100)
    specs = [
        BeatSpec(tuned, fixed_schedule(tuned, hz), column, survey(recording.counts[:, column], 10e6, 16, "x"))
        for tuned, hz, column in zip(TUNED[::-1], (REST_HZ + 2 * SPEED / WAVELENGTH_M, REST_HZ), (1, 0), strict=True)
    ]
    moving, rest = read_tracks(recording, specs, grid, None, None)
    moving.hole[dark] = True
    std = float(np.nanmedian(rest.std_cycles))
    smooth = fit_rest_phase(grid.time_s(rest.spec.tuning), rest.phase_cycles, std, rest.oscillator_hz)
    return find_leak(recording, smooth, rest.spec, moving, grid, np.broadcast_to(doppler, grid.samples))


def test_a_leak_scatters_about_what_was_put_in_as_it_says() -> None:
    found = [found_in(leaking(0.01, seed, 30.0)) for seed in range(1, 17)]
    leaks = [leak for leak in found if leak is not None]
    assert len(leaks) == 16
    along = np.array([(leak.ratio * np.exp(2j * np.pi * (leak.cycles - PHASE)) - 0.01) / leak.std for leak in leaks])
    # std is that of the amplitude, so of either part of the phasor to a half
    assert 0.5 < np.sqrt(np.mean(np.abs(along) ** 2)) < 2.0
    assert max(leak.std for leak in leaks) < 5e-4
    clear = found_in(leaking(0.01, 1, 40.0))
    assert clear is not None and clear.std == pytest.approx(leaks[0].std / np.sqrt(10.0), rel=0.1)
    assert (clear.ratio, clear.cycles) == (pytest.approx(0.01, rel=0.02), pytest.approx(PHASE, abs=3e-3))


@pytest.mark.parametrize(("share", "removed"), [(3e-4, False), (7e-4, True)])
def test_a_leak_counts_from_half_a_thousandth_of_the_beat(share: float, removed: bool) -> None:
    assert (found_in(leaking(share, snr_db=60.0)) is not None) is removed


@pytest.mark.parametrize(("sigmas", "removed"), [(3.0, False), (10.0, True)])
def test_a_leak_counts_from_six_of_its_uncertainty(sigmas: float, removed: bool) -> None:
    sure = found_in(leaking(0.05, snr_db=20.0))
    assert sure is not None and 6.0 * sure.std > 5e-4
    assert (found_in(leaking(sigmas * sure.std, snr_db=20.0)) is not None) is removed


def test_a_leak_is_read_where_the_block_flies_fast_and_is_seen_for_long_enough() -> None:
    recording = leaking(0.02)
    index = np.arange(600)
    assert found_in(recording, 39e3) is None and found_in(recording, 41e3) is not None
    assert found_in(recording, -41e3) is not None
    for samples, seen in ((48, False), (52, True)):  # half a millisecond
        fast = np.where((index >= 200) & (index < 200 + samples), 1e5, 0.0)
        leak = found_in(recording, fast)
        assert (leak is not None) is seen
    whole = found_in(recording)
    assert whole is not None and leak is not None and leak.std > 2.0 * whole.std
    assert found_in(recording, dark=slice(0, 600)) is None
    halves = found_in(recording, np.where(index < 150, 1e5, 0.0))
    longer = found_in(recording, np.where((index < 150) | (index > 250), 1e5, 0.0))
    assert halves is not None and longer is not None  # the longest stretch is taken
    assert longer.std == pytest.approx(halves.std * np.sqrt(150 / 349), rel=0.1)


def test_no_more_than_12_ms_of_flight_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    assert phase_errors.LONGEST_S == 12e-3
    whole = found_in(leaking(0.02))
    monkeypatch.setattr(phase_errors, "LONGEST_S", 1e-3)
    part = found_in(leaking(0.02))
    assert whole is not None and part is not None
    assert part.std == pytest.approx(whole.std * np.sqrt(5.9), rel=0.1)


@pytest.mark.parametrize("at", [2_000, 50_000])
def test_beside_a_loss_a_leak_is_read_in_the_first_piece_that_is_long_enough(at: int) -> None:
    lost = 1_003
    recording = leaking(0.02)
    cut = replace(recording, counts=np.delete(recording.counts, slice(at, at + lost), axis=0), gaps=(Gap(at, lost),))
    leak = found_in(cut)
    assert leak is not None
    assert leak.ratio == pytest.approx(0.02, rel=0.02)
    assert leak.cycles == pytest.approx(PHASE, abs=5e-3)


@pytest.mark.parametrize("speed", [0.002, 0.006, 0.012])  # Doppler shifts of 6, 19 and 38 kHz: in the band, and beyond
def test_a_leak_adds_to_a_phase_what_band_pass_and_decimator_leave_of_its_ripple(speed: float) -> None:
    phases = []
    for share in (0.0, 0.05):
        start = float(np.random.default_rng(1).uniform(0, 2 * np.pi))

        def alter(role: Role, t: Any, signal: Any, share: float = share, start: float = start) -> Any:
            leak = share * 8000.0 * np.cos(2 * np.pi * (REST_HZ * t + PHASE) + start)
            return signal + leak if role is Role.MEASUREMENT else signal

        recording = make_recording(free_flight(-speed), 60_000, snr_db=None, alter=alter)
        grid = Grid.of(recording, 100)
        hz = REST_HZ + 2 * speed / WAVELENGTH_M
        tuned = tune(10e6, 2.7e6, 2.8e6, 130e3, 450e3, 100)
        spec = BeatSpec(tuned, fixed_schedule(tuned, hz), 1, survey(recording.counts[:, 1], 10e6, 16, "x"))
        (track,) = read_tracks(recording, [spec], grid, None, None)
        delay_s = tuned.delay_samples / 10e6
        phases.append(track.phase_cycles + track.oscillator_hz * (grid.time_s(tuned) - delay_s))
    time_s = grid.time_s(tuned)
    rest = REST_HZ * time_s + start / (2 * np.pi)
    inner = slice(30, -30)
    added = leak_phase(Leak(0.05, 0.0, PHASE), phases[1], rest, track, grid)
    seen = phases[1] - phases[0]
    seen -= np.rint(np.nanmedian(seen))
    largest = np.abs(seen[inner]).max()
    assert largest < 0.06 / (2 * np.pi)
    # the window's centre is where both phases are meant: the leak's own phase there is PHASE
    assert np.abs(added[inner] - seen[inner]).max() < 0.03 * 0.05 / (2 * np.pi) + 0.02 * largest
