import json
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.quantity import Quantity
from analysis.shot.recording import Channel, Recording, Role, Setup
from analysis.shot.shot import AnalysisError, AnalysisSettings, Cancelled
from analysis.signal import demodulation
from analysis.signal.demodulation import demodulate
from tests.analysis.signal.beats import WAVELENGTH_M, collision, free_flight, make_recording

R, M, S = Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH


@pytest.mark.parametrize("seed", range(6))
def test_free_flight_within_what_the_cramer_rao_bound_allows(seed: int) -> None:
    random = np.random.default_rng(seed)
    velocity = float(random.uniform(-0.4, 0.4))
    rate = float(random.choice([10e6, 15e6, 20e6]))
    snr_db = float(random.choice([20, 30, 40]))
    samples = 400_000
    recording = make_recording(
        free_flight(velocity),
        samples,
        rate_hz=rate,
        snr_db=snr_db,
        seed=seed,
        amplitude=float(random.uniform(500, 2e4)),
    )
    motion = demodulate(recording, AnalysisSettings(bandwidth_hz=5e3))
    slope = np.polyfit(motion.time_s, motion.displacement_m, 1)[0]
    snr = 10 ** (snr_db / 10)
    bound_hz = np.sqrt(12 * rate**2 / ((2 * np.pi) ** 2 * snr * samples * (samples**2 - 1)))
    # two beats, each at the bound, over a record shortened by the filters
    assert slope - velocity == pytest.approx(0, abs=4.5 * 1.05 * np.sqrt(2) * WAVELENGTH_M / 2 * bound_hz)


def test_an_impact_has_the_right_signs_and_shape() -> None:
    truth = collision(0.265, 20e-3)
    recording = make_recording(truth, 400_000, order=(S, M, R), snr_db=40)
    motion = demodulate(recording, AnalysisSettings())
    exact = truth(motion.time_s)
    error = motion.displacement_m - exact
    assert np.std(error) < 1.1 * np.median(motion.displacement_std_m)
    assert motion.velocity_m_per_s[10] == pytest.approx(-0.265, abs=3e-5)
    assert motion.velocity_m_per_s[-10] == pytest.approx(0.265, abs=3e-5)
    assert motion.force_n.max() == pytest.approx(0.01785 * 0.265 * np.pi / 10e-3, rel=0.01)
    assert motion.valid.all()
    assert isinstance(motion.rest_frequency_hz, Quantity)
    assert abs(motion.rest_frequency_hz.value - 2.73e6) < 5 * motion.rest_frequency_hz.std


def test_the_result_does_not_depend_on_the_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = make_recording(collision(0.2, 10e-3, 5e-3), 200_000)
    whole = demodulate(recording, AnalysisSettings())
    monkeypatch.setattr("analysis.signal.track.BLOCK_SAMPLES", 7919)
    cut = demodulate(recording, AnalysisSettings())
    for name in ("time_s", "displacement_m", "velocity_m_per_s", "force_n", "force_std_n", "valid"):
        assert np.array_equal(getattr(whole, name), getattr(cut, name), equal_nan=True)


def _spoiled(**changes: object) -> Recording:
    base: dict[str, object] = {
        "name": "x",
        "counts": make_recording(free_flight(0.1), 60_000).counts,
        "sample_rate_hz": 10e6,
        "channels": (Channel(R, 1e-4), Channel(M, 1e-4)),
        "setup": Setup(0.01785, digitizer_bits=16),
    }
    return Recording(**(base | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sample_rate_hz": 0.0}, "sample rate"),
        ({"sample_rate_hz": -3.0}, "sample rate"),
        ({"sample_rate_hz": float("nan")}, "sample rate"),
        ({"counts": np.full((60_000, 2), 7, np.int16)}, "flat"),
        ({"counts": np.zeros((0, 2), np.int16)}, "no samples"),
        ({"counts": make_recording(free_flight(0.1), 3_000).counts}, "too short"),
        ({"counts": make_recording(free_flight(0.1), 100).counts}, "too short"),
        ({"counts": np.random.default_rng(1).normal(0, 300, (60_000, 2)).astype(np.int16)}, "noise"),
        ({"counts": make_recording(free_flight(0.1), 60_000, amplitude=4e5).counts}, "saturated"),
        ({"channels": (Channel(S, 1e-4), Channel(M, 1e-4))}, "rest frequency"),
        ({"channels": (Channel(R, 1e-4), Channel(S, 1e-4))}, "measurement"),
        ({"setup": Setup(0.0)}, "mass"),
        ({"setup": Setup(0.01, wavelength_air_m=-1.0)}, "wavelength"),
    ],
)
def test_a_recording_that_cannot_be_analysed_is_refused_in_one_line(changes: dict[str, object], words: str) -> None:
    with pytest.raises(AnalysisError, match=words) as raised:
        demodulate(_spoiled(**changes), AnalysisSettings())
    assert "\n" not in str(raised.value)


def test_a_stated_rest_frequency_replaces_the_reference() -> None:
    recording = make_recording(free_flight(-0.2), 100_000, order=(M,), rest_hz=2.5e6)
    motion = demodulate(recording, AnalysisSettings())
    assert np.mean(motion.velocity_m_per_s) == pytest.approx(-0.2, abs=1e-6)
    assert motion.rest_frequency_hz == Quantity(2.5e6, 0.0, "given")


def test_demodulation_can_be_cancelled() -> None:
    with pytest.raises(Cancelled):
        demodulate(_spoiled(), AnalysisSettings(), cancelled=lambda: True)


def _load(stem: Path) -> Recording:
    about = json.loads(stem.with_suffix(".sigmf-meta").read_text())["global"]
    counts = np.memmap(stem.with_suffix(".sigmf-data"), "<i2", "r").reshape(-1, about["core:num_channels"])
    channels = tuple(Channel(Role(c["role"]), c["volts_per_count"]) for c in about["lmm:channels"])
    setup = Setup(about["lmm:setup"]["moving_mass_kg"], wavelength_air_m=632.8e-9, digitizer_bits=12)
    return Recording(stem.name, counts, about["core:sample_rate"], channels, setup, about["lmm:trigger_sample"])


def test_the_independent_recording_of_the_paper(recordings: Path) -> None:
    motion = demodulate(_load(recordings / "paper" / "shot-1"), AnalysisSettings())
    before, after = motion.time_s < 8e-3, motion.time_s > motion.time_s[-1] - 20e-3
    assert np.mean(motion.velocity_m_per_s[before]) == pytest.approx(-0.265, abs=1e-6)
    assert np.mean(motion.velocity_m_per_s[after]) == pytest.approx(0.261702, abs=1e-6)
    assert motion.sample_rate_hz == pytest.approx(100e3)


def test_a_beat_that_never_leaves_its_band_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading takes most of the time of a shot; wider bands are for beats that a narrow one misses."""
    read: list[int] = []
    tracks = demodulation.read_tracks
    monkeypatch.setattr(demodulation, "read_tracks", lambda *of: read.append(1) or tracks(*of))  # type: ignore[func-returns-value]
    motion = demodulate(make_recording(collision(0.265, 6e-3), 120_000), AnalysisSettings())
    assert motion.valid.all() and motion.flags == ()
    assert len(read) == 1
