"""Cross-talk, swapped cables, and recordings with reversed time or direction."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import hilbert

from analysis.pipeline import analyse
from analysis.shot.impact import Impact
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Shot
from analysis.signal.cross_talk import BLOCK, find_cross_talk
from analysis.signal.survey import survey
from tests.analysis.synthetic_collision import Synthetic
from tests.beats import recording_of

RIG = Synthetic(speed_m_per_s=0.17)
READ = AnalysisSettings(fit=False)


@lru_cache(maxsize=1)
def sound() -> Recording:
    return recording_of(RIG)


@lru_cache(maxsize=1)
def truth() -> Impact:
    impact = analyse(sound(), READ).impact
    assert impact is not None
    return impact


def with_columns(columns: list[NDArray[np.float64]]) -> Recording:
    """Return the sound recording with these channels in their places."""
    counts = np.clip(np.rint(np.stack(columns, axis=1)), -2048, 2047).astype("<i2")
    counts.flags.writeable = False
    return replace(sound(), counts=counts)


def coupled(share: float, turned_deg: float = 0.0, back: float = 0.0, varies: float = 0.0) -> Recording:
    """Return a recording with a share of PD1 in PD0, its phase turned, and of PD0 ``back`` in PD1."""
    rest, beat, switch = sound().counts.T.astype(np.float64)
    turned = (hilbert(beat - beat.mean()) * np.exp(1j * np.deg2rad(turned_deg))).real
    share_now = share * (1.0 + varies * np.sin(np.linspace(0.0, 40.0, rest.size)))
    return with_columns([rest + share_now * turned, beat + back * rest, switch])


def check(shot: Shot) -> None:
    impact = shot.impact
    assert impact is not None and shot.problem is None
    for name in ("velocity_in_m_per_s", "cor_quasi_static", "deflection_max_m", "contact_time_s", "force_peak_n"):
        read, right = getattr(impact, name), getattr(truth(), name)
        assert isinstance(read, Quantity) and isinstance(right, Quantity), name
        assert abs(read.value - right.value) < 3.0 * right.std + 1e-6 * abs(right.value), name


@pytest.mark.parametrize(("share", "turned_deg"), [(0.03, 0.0), (0.05, 0.0), (0.05, 60.0), (0.1, 180.0), (0.4, 0.0)])
def test_cross_talk_is_removed_and_flagged(share: float, turned_deg: float) -> None:
    shot = analyse(coupled(share, turned_deg), READ)
    assert shot.flags == ("cross_talk_removed",)
    check(shot)


def test_cross_talk_in_both_directions() -> None:
    shot = analyse(coupled(0.05, back=0.05), READ)
    assert set(shot.flags) == {"cross_talk_removed", "leak_removed"}
    impact = shot.impact
    assert impact is not None and isinstance(impact.deflection_max_m, Quantity)
    assert isinstance(truth().deflection_max_m, Quantity)
    assert impact.deflection_max_m.value == pytest.approx(truth().deflection_max_m.value, rel=1e-4)


def test_a_recording_with_little_cross_talk_is_unchanged() -> None:
    assert analyse(sound(), READ).flags == () == analyse(coupled(0.004), READ).flags


@pytest.mark.parametrize("size", [0.009, 0.011, 0.05])
def test_cross_talk_is_measured_against_the_beat_that_it_disturbs(size: float) -> None:
    """A hundredth of PD0's own amplitude is removed, less is left."""
    coupling = size * 0.7 / 0.6  # of PD1's 0.6 V into PD0's 0.7 V
    rest, beat, _ = coupled(coupling).counts.T
    found = find_cross_talk(rest, beat, survey(rest, 10e6, 12, "PD0"), survey(beat, 10e6, 12, "PD1"), 10e6)
    assert (found is not None) is (size > 0.01)
    if found is not None:
        assert found.ratio == pytest.approx(size, rel=0.03)


def test_cross_talk_that_changes_is_flagged_and_no_deflection_given() -> None:
    shot = analyse(coupled(0.1, varies=1.0), READ)
    assert "cross_talk" in shot.flags and "samples_lost" not in shot.flags
    assert shot.impact is not None and isinstance(shot.impact.deflection_max_m, NotSeen)
    assert "cross-talk of PD1 in PD0" in shot.impact.deflection_max_m.reason


def test_blocks_with_a_fault_take_no_part_in_the_estimate() -> None:
    """Bursts of PD1 in every twentieth block of PD0: the cross-talk is found as without them."""
    recording = coupled(0.4)
    rest, beat, switch = recording.counts.T.astype(np.float64)
    burst = np.zeros(rest.size)
    for begin in range(0, rest.size - 20 * BLOCK, 20 * BLOCK):
        burst[begin : begin + BLOCK] = 1.0
    spoilt = with_columns([rest + burst * (beat - beat.mean()), beat, switch])
    found = []
    for one in (recording, spoilt):
        moving, still = (one.counts[:, column] for column in (1, 0))
        surveys = [survey(of, one.sample_rate_hz, one.setup.digitizer_bits, "channel") for of in (still, moving)]
        found.append(find_cross_talk(still, moving, *surveys, one.sample_rate_hz))
    assert found[0] is not None and found[1] is not None
    assert found[1].taps == pytest.approx(found[0].taps, abs=2e-3)


def test_lost_samples_are_found_despite_cross_talk() -> None:
    whole = coupled(0.05)
    at = 260_000  # in the contact
    counts = np.delete(whole.counts, slice(at, at + 5), axis=0)
    counts.flags.writeable = False
    shot = analyse(replace(whole, counts=counts), READ)
    assert {"cross_talk_removed", "samples_lost"} <= set(shot.flags)
    impact = shot.impact
    assert impact is not None and isinstance(impact.deflection_max_m, Quantity)
    assert isinstance(truth().deflection_max_m, Quantity)
    assert impact.deflection_max_m.value == pytest.approx(truth().deflection_max_m.value, rel=1e-3)


def test_swapped_cables_are_named() -> None:
    rest, beat, switch = sound().counts.T.astype(np.float64)
    problem = analyse(with_columns([beat, rest, switch]), READ).problem
    assert problem is not None and "swapped" in problem and "PD0's beat moves by" in problem


def test_a_recording_that_runs_backwards_is_named() -> None:
    counts = sound().counts[::-1].copy()
    counts.flags.writeable = False
    problem = analyse(replace(sound(), counts=counts), READ).problem
    assert problem is not None and "time runs backwards" in problem


def test_a_reversed_direction_is_named() -> None:
    rate, rest_hz = sound().sample_rate_hz, 2.73e6
    time = np.arange(sound().samples) / rate
    rest, beat, switch = sound().counts.T.astype(np.float64)
    mirrored = (hilbert(beat).conj() * np.exp(4j * np.pi * rest_hz * time)).real  # above the rest becomes below
    problem = analyse(with_columns([rest, mirrored, switch]), READ).problem
    assert problem is not None and "the sense is reversed" in problem


def test_a_record_of_the_way_back_alone_says_that_the_trigger_came_too_late() -> None:
    released = truth().release_time_s
    assert isinstance(released, Quantity)
    counts = sound().counts[round((released.value + 2e-3) * sound().sample_rate_hz) :]
    problem = analyse(replace(sound(), counts=counts, trigger_sample=0), READ).problem
    assert problem is not None and "no impact" in problem and "triggered on its way back" in problem
