"""One plan in numbers: where its oscillators stand, what of a dim beat is believed, how wide the rest beat's band."""

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError, AnalysisSettings
from analysis.signal.demodulation_plan import DemodulationPlan, _plan, demodulation_plans
from analysis.signal.survey import Survey
from analysis.signal.tuning import BATCH
from tests.analysis.signal.beats import free_flight, make_recording

RATE = 10e6
RECORDING = make_recording(free_flight(0.0), 400_000)
SAMPLE = np.arange(0, 400_000 - 512, 10_000)


def seen(frequency_hz: np.ndarray, snr_db: float = 40.0, dark: tuple[int, ...] = ()) -> Survey:
    lit = ~np.isin(np.arange(SAMPLE.size), dark)
    return Survey(0.0, 800.0, snr_db, SAMPLE, 512, frequency_hz, lit, 0.0, 0.0)


FALLING = 3.6e6 - 1.0 * SAMPLE  # 400 kHz over the record
REST = seen(np.full(SAMPLE.size, 2.7312e6))


def oscillators(plan: DemodulationPlan) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle sample of every batch and the oscillator it is read with."""
    _, (moving, *_rest) = plan
    batch = BATCH * moving.tuning.decimation
    hz = [moving.tuning.oscillator_hz(int(step)) for step in moving.schedule.steps]
    return (np.arange(moving.schedule.batch.size) + 0.5) * batch, np.array(hz)[moving.schedule.batch]


def test_the_oscillator_stands_where_the_survey_saw_the_beat_in_the_middle_of_its_stretches() -> None:
    plan = _plan(130e3, seen(FALLING), REST, RECORDING, AnalysisSettings())
    at, hz = oscillators(plan)
    inside = (at > 300) & (at < 390_000)
    off = hz[inside] - (3.6e6 - (at[inside] - 256.0))
    assert (
        np.abs(off).max() < 20.1e3 and abs(off.mean()) < 450.0
    )  # half the spacing; 512 Hz lie between a stretch's ends
    dark = seen(np.where(np.isin(np.arange(SAMPLE.size), (7, 8)), 1e6, FALLING), dark=(7, 8))
    again = oscillators(_plan(130e3, dark, REST, RECORDING, AnalysisSettings()))[1]
    assert np.array_equal(again, hz)  # between those that were seen


@pytest.mark.parametrize(("snr_db", "believed"), [(5.9, False), (6.1, True)])
def test_of_a_dim_beat_a_stretch_that_differs_from_both_neighbours_is_not_believed(
    snr_db: float, believed: bool
) -> None:
    odd = FALLING.astype(np.float64)
    odd[20] += 200e3
    at, hz = oscillators(_plan(130e3, seen(odd, snr_db), REST, RECORDING, AnalysisSettings()))
    near = np.abs(at - SAMPLE[20] - 256) < 3000
    assert bool(np.abs(hz[near] - (3.6e6 - at[near])).max() > 100e3) is believed


@pytest.mark.parametrize("spread_hz", [0.0, 60e3, 500e3])
def test_the_rest_beats_band_holds_its_spread_and_its_phases_come_twice_a_motion_sample(spread_hz: float) -> None:
    wandering = 2.7312e6 + spread_hz * np.linspace(-0.5, 0.5, SAMPLE.size)
    chosen = AnalysisSettings()
    motion_step, (_, rest) = _plan(130e3, seen(FALLING), seen(wandering), RECORDING, chosen)
    least = 50e3 + min(0.5 * spread_hz, 1e5) + 0.5 * chosen.motion_rate_hz
    assert least <= rest.tuning.half_width_hz < least + 20e3
    assert rest.tuning.half_width_hz % 20e3 == pytest.approx(0.0, abs=1e-6)
    assert rest.tuning.phase_rate_hz >= 2.0 * RATE / motion_step
    assert motion_step % rest.tuning.decimation == 0
    (step,) = rest.schedule.steps
    assert rest.tuning.oscillator_hz(int(step)) == pytest.approx(np.median(wandering), abs=200.0)


def test_a_narrow_band_is_tried_only_where_no_other_is_possible() -> None:
    for hz, widths in ((0.125e6, [90e3]), (0.15e6, [120e3]), (0.25e6, [180e3, 120e3])):
        near_zero = seen(np.linspace(hz, hz + 1e3, SAMPLE.size))
        plans = list(demodulation_plans(near_zero, None, RECORDING, AnalysisSettings()))
        assert [moving.tuning.half_width_hz for _, (moving,) in plans] == pytest.approx(widths)
    assert len(list(demodulation_plans(seen(FALLING), None, RECORDING, AnalysisSettings()))) == 3
    impossible = seen(np.full(SAMPLE.size, 0.05e6))
    with pytest.raises(AnalysisError, match="band of 0 to 5 MHz"):
        list(demodulation_plans(impossible, None, RECORDING, AnalysisSettings()))


def test_a_motion_rate_is_met_by_whole_phases_at_least_two() -> None:
    for rate in (2e4, 1e5, 4e5):
        chosen = AnalysisSettings(motion_rate_hz=rate, bandwidth_hz=2e3)
        step, (moving,) = _plan(130e3, seen(FALLING), None, RECORDING, chosen)
        factor = step // moving.tuning.decimation
        assert step == factor * moving.tuning.decimation and factor >= 2
        assert RATE / step == pytest.approx(rate, rel=0.25)
