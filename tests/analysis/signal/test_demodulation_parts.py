"""The parts of a demodulation: what is refused, what is flagged, and each number of the motion from both tracks."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.motion import ARRAYS, Motion
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Gap, Plate, Recording, Role, Setup
from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.signal import demodulation
from analysis.signal.demodulation import (
    _beat_flags,
    _check,
    _delay_s,
    _derived,
    _gap_flags,
    _mean_hz,
    _missed,
    _quality,
    _rest,
    _start,
    _with_cross_talk_removed,
    _with_losses,
    demodulate,
)
from analysis.signal.filters import derivative_gains, derivatives
from tests.analysis.signal.beats import WAVELENGTH_M, collision, free_flight, make_recording

RATE = 10e6
PLAIN = make_recording(free_flight(-0.2), 60_000)


@pytest.mark.parametrize(
    ("changes", "right"),
    [
        ({"motion_rate_hz": RATE / 4, "bandwidth_hz": 1e4}, True),
        ({"motion_rate_hz": 1.001 * RATE / 4, "bandwidth_hz": 1e4}, False),
        ({"motion_rate_hz": 0.0, "bandwidth_hz": 1e4}, False),
        ({"motion_rate_hz": 1e5, "bandwidth_hz": 0.949 * 0.35e5}, True),
        ({"motion_rate_hz": 1e5, "bandwidth_hz": 0.951 * 0.35e5}, False),
        ({"motion_rate_hz": 1e5, "bandwidth_hz": 0.0}, False),
        ({"rest": "instantaneous"}, True),
        ({"rest": "rough"}, False),
    ],
)
def test_settings_that_the_samples_cannot_carry_are_refused(changes: dict[str, Any], right: bool) -> None:
    chosen = AnalysisSettings(**changes)
    if right:
        _check(PLAIN, chosen)
    else:
        with pytest.raises(AnalysisError):
            _check(PLAIN, chosen)


@pytest.mark.parametrize(("mass", "right"), [(1e-9, True), (0.0, False), (-1.0, False), (float("nan"), False)])
def test_a_block_has_a_mass(mass: float, right: bool) -> None:
    recording = replace(PLAIN, setup=replace(PLAIN.setup, moving_mass_kg=mass))
    if right:
        _check(recording, AnalysisSettings())
    else:
        with pytest.raises(AnalysisError, match="mass"):
            _check(recording, AnalysisSettings())


def test_a_place_begins_at_zero_on_a_parabola_through_its_first_64_samples() -> None:
    n = np.arange(200.0)
    parabola = 3.0 - 0.2 * n + 1e-3 * n**2
    assert _start(np.where(n < 64, parabola, 99.0)) == pytest.approx(3.0, rel=1e-12)
    jagged = parabola + np.random.default_rng(1).standard_normal(200)
    assert _start(jagged) == pytest.approx(np.polyval(np.polyfit(n[:64], jagged[:64], 2), 0.0), rel=1e-9)
    assert _start(parabola[:8]) == pytest.approx(3.0, rel=1e-9)
    with pytest.raises(AnalysisError, match="no light"):
        _start(parabola[:7])


def test_a_walk_of_the_path_adds_to_the_uncertainties_of_velocity_and_acceleration() -> None:
    random, std, rate = np.random.default_rng(2), 1e-10, 1e5
    walk = np.cumsum(3e-8 / np.sqrt(rate) * random.standard_normal(8000))
    for path, walks in ((walk, True), (0.0 * walk, False)):
        place = path - 0.2 * np.arange(8000) / rate + std * random.standard_normal(8000)
        stds = np.full(8000, std)
        velocity, acceleration, velocity_std, acceleration_std, found = _derived(place, stds, rate, 1e4)
        expected = derivatives(place, rate, 1e4)
        assert np.array_equal(velocity, expected[0]) and np.array_equal(acceleration, expected[1])
        assert found == pytest.approx(3e-8 if walks else 0.0, rel=0.15)
        white, wandering = (derivative_gains(np.ones(8000, bool), rate, 1e4, walk=w) for w in (False, True))
        for got, one, other in zip((velocity_std, acceleration_std), white, wandering, strict=True):
            assert got == pytest.approx(np.sqrt((std * one) ** 2 + (found * other) ** 2), rel=1e-9)
        assert np.std(velocity[100:-100]) == pytest.approx(np.median(velocity_std), rel=0.15)
        assert np.std(acceleration[100:-100]) == pytest.approx(np.median(acceleration_std), rel=0.15)


def _track(**changes: Any) -> Any:
    survey = SimpleNamespace(clipped_fraction=0.0, harmonics=0.0, amplitude_counts=500.0, snr_db=33.0)
    tuning = SimpleNamespace(half_width_hz=100e3, delay_samples=35.5, sample_rate_hz=RATE)
    cycles = 0.02 * np.arange(50.0)
    track = {
        "phase_cycles": cycles, "std_cycles": np.full(50, 1e-3), "amplitude_counts": np.full(50, 500.0),
        "hole": np.zeros(50, bool), "breaks": (), "doubtful": 0, "oscillator_hz": 2.7e6,
        "spec": SimpleNamespace(survey=survey, tuning=tuning, column=1), "offset_hz": lambda grid: np.zeros(49),
    }  # fmt: skip
    return SimpleNamespace(**track | changes)


def _grid(**changes: Any) -> Any:
    return SimpleNamespace(
        **{"rate_hz": 1e5, "pieces": ((0, 5000, 0),), "time_s": lambda tuning: np.arange(50) / 1e5} | changes
    )


def _surveyed(**of: float) -> Any:
    spec = _track().spec
    return _track(spec=SimpleNamespace(survey=SimpleNamespace(**vars(spec.survey) | of), tuning=spec.tuning))


def test_gaps_holes_and_bridges_are_flagged() -> None:
    dark = np.zeros(50, bool)
    dark[7] = True
    two = ((0, 2000, 0), (2000, 5000, 2010))
    assert _gap_flags(_grid(), [_track(), _track()], ~dark & False) == []
    assert _gap_flags(_grid(), [_track()], dark) == ["drop_out"]
    assert _gap_flags(_grid(pieces=two), [_track()], dark) == ["gap"]
    assert _gap_flags(_grid(), [_track(), _track(doubtful=1)], ~dark & False) == ["fringe_doubtful"]


def test_what_a_beat_suffers_is_flagged_of_either_beat_on_both_sides_of_each_gate() -> None:
    grid, plain = _grid(), _track()
    assert _beat_flags(PLAIN, grid, [plain, plain], 0.0, 50) == []
    for name, value, flag in (("clipped_fraction", 1e-4, "clipped"), ("harmonics", 0.01, "harmonics")):
        for times, flagged in ((0.9, False), (1.1, True)):
            worse = _surveyed(**{name: times * value})
            for tracks in ([worse, plain], [plain, worse], [worse]):
                assert _beat_flags(PLAIN, grid, tracks, 0.0, 50) == ([flag] if flagged else [])
    assert _beat_flags(PLAIN, grid, [plain], 0.011, 50) == ["harmonics"]
    strayed = np.zeros(49)
    strayed[40] = -1.01e5
    away = _track(offset_hz=lambda grid: strayed)
    assert _beat_flags(PLAIN, grid, [away, plain], 0.0, 42) == ["out_of_band"]
    assert _beat_flags(PLAIN, grid, [away, plain], 0.0, 41) == []  # beyond the last sample that is known
    assert _beat_flags(PLAIN, grid, [plain, away], 0.0, 50) == []
    unknown = replace(PLAIN, gaps=(Gap(30_000, None),))
    assert _beat_flags(unknown, grid, [plain], 0.0, 50) == ["gap_unknown"]
    assert _beat_flags(replace(PLAIN, gaps=(Gap(30_000, 7),)), grid, [plain], 0.0, 50) == []


def test_samples_missed_are_dark_or_outside_of_the_band() -> None:
    hole = np.zeros(50, bool)
    hole[3:5] = True
    offset = np.zeros(49)
    offset[[10, 20, 48]] = 1.01e5, -1.01e5, 0.99e5
    assert _missed(_track(hole=hole, offset_hz=lambda grid: offset), _grid()) == 4


def test_a_beats_frequency_is_its_oscillators_and_the_usual_step_of_its_phase() -> None:
    cycles = 0.02 * np.arange(50.0)
    cycles[25:] += 0.4
    cycles[10] = np.nan
    assert _mean_hz(_track(phase_cycles=cycles), _grid()) == pytest.approx(2.7e6 + 0.02 * 1e5)
    assert _delay_s(_track()) == pytest.approx(35.5 / RATE)


def test_a_beats_quality_is_read_from_the_first_32th_of_its_longest_stretch() -> None:
    cycles = np.full(2000, np.nan)
    cycles[:600] = 0.3 * np.arange(600)
    cycles[900:1990] = np.where(np.arange(1090) < 34, 0.02, 0.5) * np.arange(1090)
    recording = replace(PLAIN, channels=(PLAIN.channels[0], replace(PLAIN.channels[1], volts_per_count=-2e-4)))
    quality = _quality(recording, _track(phase_cycles=cycles), _grid())
    assert quality.frequency_hz == pytest.approx(2.7e6 + 0.02 * 1e5, rel=1e-9)
    assert (quality.amplitude_v, quality.snr_db, quality.clipped_fraction) == (pytest.approx(0.1), 33.0, 0.0)
    short = 0.02 * np.arange(40.0)
    short[16:] += 5.0
    assert _quality(recording, _track(phase_cycles=short), _grid()).frequency_hz == pytest.approx(2.7e6 + 0.02 * 1e5)


def test_a_given_rest_beat_is_its_frequency_times_the_time_with_no_noise() -> None:
    alone = replace(PLAIN, setup=replace(PLAIN.setup, rest_frequency_hz=2.5e6))
    rest = _rest(alone, AnalysisSettings(), _grid(), [_track()], np.array([0.0, 0.2]), [])
    assert rest.cycles.tolist() == [0.0, 5e5] and rest.std_cycles == 0.0 and rest.smooth is None
    assert rest.frequency_hz == Quantity(2.5e6, 0.0, "given")


@pytest.mark.parametrize("rest", ["smoothed", "instantaneous"])
def test_a_recorded_rest_beat_is_its_phase_with_the_oscillator_at_the_motions_times(rest: str) -> None:
    random, n = np.random.default_rng(3), np.arange(4000.0)
    time_s = n / 1e5 + 3e-6
    noisy = 0.01 * n + 0.2 + 1e-3 * random.standard_normal(4000)
    noisy[500] = np.nan
    track = _track(phase_cycles=noisy, std_cycles=np.full(4000, 1e-3), hole=np.isnan(noisy))
    grid, flags = _grid(time_s=lambda tuning: time_s), list[str]()
    found = _rest(PLAIN, AnalysisSettings(rest=rest), grid, [_track(), track], time_s[:3000], flags)
    turned = 2.7e6 * (time_s[:3000] - 35.5 / RATE)
    smooth = np.polyval(np.polyfit(time_s[n != 500], noisy[n != 500], 1), time_s[:3000])
    expected = smooth if rest == "smoothed" else np.where(n[:3000] == 500, smooth, noisy[:3000])
    assert found.cycles - turned == pytest.approx(expected, abs=2e-5)
    assert np.all(found.std_cycles == (0.0 if rest == "smoothed" else 1e-3)) and flags == []
    assert found.smooth is not None and found.frequency_hz.value == pytest.approx(2.7e6 + 1e3, abs=0.1)
    drifting = _track(phase_cycles=noisy + 1e-8 * n**2, std_cycles=np.full(4000, 1e-3), hole=np.isnan(noisy))
    _rest(PLAIN, AnalysisSettings(), grid, [_track(), drifting], time_s, flags)
    assert flags == ["rest_drift"]


@pytest.mark.parametrize(("times", "flagged"), [(2.7, False), (3.4, True)])
def test_a_rest_beat_is_unsteady_beyond_three_of_its_noise(times: float, flagged: bool) -> None:
    n, flags = np.arange(4000.0), list[str]()
    hum = times * 1e-3 * np.sqrt(2.0) * np.sin(2 * np.pi * n / 3.0)  # averages out
    noisy = 0.01 * n + hum + 1e-3 * np.random.default_rng(4).standard_normal(4000)
    track = _track(phase_cycles=noisy, std_cycles=np.full(4000, 1e-3), hole=np.isnan(noisy))
    _rest(PLAIN, AnalysisSettings(), _grid(time_s=lambda tuning: n / 1e5), [_track(), track], n / 1e5, flags)
    assert ("rest_unsteady" in flags) is flagged


def _recorded(**changes: Any) -> Recording:
    setup = Setup(
        0.02, moving_mass_u_kg=3e-6, wavelength_air_m=WAVELENGTH_M, digitizer_bits=16,
        plate=Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8510.0, 131e9),
    )  # fmt: skip
    return replace(make_recording(collision(0.1, 3e-3, 2e-3), 60_000, **changes), setup=setup, trigger_sample=12_345)


def test_a_motion_is_made_of_both_phases_and_carries_what_the_recording_states() -> None:
    recording = _recorded()
    motion = demodulate(recording, AnalysisSettings(bandwidth_hz=8e3))
    truth = collision(0.1, 3e-3, 2e-3)(motion.time_s)
    left = motion.displacement_m - truth
    assert np.std(left) == pytest.approx(np.median(motion.displacement_std_m), rel=0.2)
    assert np.array_equal(motion.force_n, 0.02 * motion.acceleration_m_per_s2)
    assert np.array_equal(motion.force_std_n, 0.02 * motion.acceleration_std_m_per_s2)
    velocity, acceleration = derivatives(motion.displacement_m, motion.sample_rate_hz, 8e3)
    assert motion.velocity_m_per_s == pytest.approx(velocity, abs=1e-12)
    assert motion.acceleration_m_per_s2 == pytest.approx(acceleration, abs=1e-5)
    stated = motion.sample_rate_hz, motion.bandwidth_hz, motion.displacement_band_hz, motion.wavelength_m
    assert stated == (pytest.approx(1e5), 8e3, pytest.approx(3e4), WAVELENGTH_M)
    assert (motion.moving_mass_kg, motion.moving_mass_u_kg) == (0.02, 3e-6)
    assert motion.plate is recording.setup.plate
    assert motion.trigger_time_s == recording.trigger_time_s == 12_345 / RATE
    assert (motion.rate_error, motion.flags) == (0.0, ())
    assert not any(getattr(motion, name).flags.writeable for name in ARRAYS)
    both = demodulate(recording, AnalysisSettings(bandwidth_hz=8e3, rest="instantaneous"))
    assert np.median(both.displacement_std_m / motion.displacement_std_m) == pytest.approx(np.sqrt(2.0), rel=0.15)


def test_a_path_that_walks_is_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demodulation, "random_walk_growth", lambda *of: 2e-8)
    motion = demodulate(_recorded(), AnalysisSettings())
    assert motion.flags == ("wander",)


def test_what_was_dark_is_no_number_in_any_array_of_the_motion() -> None:
    def dimmed(role: Role, t: Any, signal: Any) -> Any:
        return np.where((t > 2e-3) & (t < 2.2e-3), 100.0, signal) if role is Role.MEASUREMENT else signal

    motion = demodulate(_recorded(alter=dimmed), AnalysisSettings())
    dark = (motion.time_s > 2.05e-3) & (motion.time_s < 2.15e-3)
    assert not motion.valid[dark].any() and motion.flags == ("drop_out",)
    arrays = [getattr(motion, name) for name in ARRAYS if name not in ("time_s", "valid")]
    assert all(np.isnan(array[~motion.valid]).all() for array in arrays)
    assert np.isfinite(motion.displacement_m[motion.valid]).all() and 0 < np.count_nonzero(~motion.valid) < 50


@pytest.mark.parametrize("swapped", [False, True])
def test_cables_that_were_swapped_are_told_by_which_beat_moves(swapped: bool) -> None:
    recording = make_recording(collision(0.265, 3e-3, 2e-3), 60_000)
    if not swapped:
        assert isinstance(demodulate(recording, AnalysisSettings()), Motion)
        return
    with pytest.raises(AnalysisError, match=r"PD0's beat moves by 1\d\d\d kHz and PD1's stands still"):
        demodulate(replace(recording, counts=recording.counts[:, ::-1].copy()), AnalysisSettings())


def test_losses_are_looked_for_where_a_phase_jumps_and_only_once() -> None:
    calls: list[Any] = []
    found = (Gap(30_000, 3),)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demodulation, "find_losses", lambda *of: calls.append(of[2]) or found)
        patch.setattr(demodulation, "phase_jump_samples", lambda track: [7] if track.doubtful else [])
        patch.setattr(demodulation, "has_phase_jumps", lambda track: track.doubtful > 0)
        grid = _grid(stored_sample=lambda at, tuning: 100 * at)
        calm, odd = _track(), _track(doubtful=1)
        assert _with_losses(PLAIN, grid, [calm, calm]) is None and calls == []
        for tracks, pd1_jumps in (([odd, calm], [700]), ([calm, odd], [])):
            mended = _with_losses(replace(PLAIN, gaps=(Gap(50_000, 1),), flags=("x",)), grid, tracks)
            assert mended is not None and calls.pop() == pd1_jumps
            assert (mended.gaps, mended.flags) == ((Gap(30_000, 3), Gap(50_000, 1)), ("x", "samples_lost"))
            assert _with_losses(mended, grid, tracks) is None
            assert _with_losses(PLAIN, grid, tracks[:1]) is None
        spec = _surveyed(clipped_fraction=1.1e-4).spec
        assert _with_losses(PLAIN, grid, [_track(doubtful=1, spec=spec), calm]) is None
        spec = _surveyed(clipped_fraction=0.9e-4).spec
        assert _with_losses(PLAIN, grid, [_track(doubtful=1, spec=spec), calm]) is not None
        found = ()
        assert _with_losses(PLAIN, grid, [odd, calm]) is None


@pytest.mark.parametrize(("left", "flags"), [(0.0, 1), (1.0, 2)])
def test_a_beat_removed_from_the_other_channel_is_flagged_and_what_is_left_of_it_too(left: float, flags: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demodulation, "find_cross_talk", lambda *of: SimpleNamespace(left=left))
        patch.setattr(demodulation, "without_cross_talk", lambda pd0, pd1, found: pd0 - pd1)
        cleaned = _with_cross_talk_removed(PLAIN, SimpleNamespace(), SimpleNamespace())  # type: ignore[arg-type]
        assert cleaned is not None and len(cleaned.flags) == flags
        assert np.array_equal(cleaned.counts[:, 0], PLAIN.counts[:, 0] - PLAIN.counts[:, 1])
        assert np.array_equal(cleaned.counts[:, 1], PLAIN.counts[:, 1]) and not cleaned.counts.flags.writeable
        again = _with_cross_talk_removed(cleaned, SimpleNamespace(), SimpleNamespace())  # type: ignore[arg-type]
        assert again is None
        assert _with_cross_talk_removed(PLAIN, SimpleNamespace(), None) is None  # type: ignore[arg-type]
