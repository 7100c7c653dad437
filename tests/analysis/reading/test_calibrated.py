"""The ± of every reading is its scatter: neither less nor more, on a quiet table and in a building.

A hundred shots of one collision, integrated apart from the model, with white noise and a floor of known strength; the
mass is known, and the force is smoothed at one cut-off, so that nothing but noise stands in a ±.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from analysis.reading import pulse
from analysis.reading.read import _between_flights, _ratio, _shares, read_impact
from analysis.shot.impact import Impact
from analysis.shot.quantity import Quantity
from tests.analysis.disturbance import Disturbance, disturbed_motion
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_of

SHOTS = 100
TRUE: Mapping[str, float | None] = {
    "velocity_in_m_per_s": -0.265,
    "velocity_out_m_per_s": 0.261702343,
    "cor_quasi_static": 0.261702343 / 0.265,
    "cor_impulse": 0.261702343 / 0.265,
    "force_peak_n": 0.511915,
    "force_fwhm_s": None,  # whatever the low-pass leaves of it
    "contact_time_s": 28.70771255e-3,
    "deflection_max_m": 2.388512e-3,
    "stiffness_slope_n_per_m": 214.33,
    "cor_kinetic.force_peaks": 0.5632,
    "cor_kinetic.onsets": 0.5003,
    "cor_kinetic.flights": 0.16795,
}


def _numbers(impact: Impact) -> dict[str, Any]:
    kinetic = impact.cor_kinetic
    return {name: getattr(kinetic if "." in name else impact, name.rsplit(".")[-1]) for name in TRUE}


@pytest.fixture(scope="module", params=["", "VC-C"])
def seen(request: pytest.FixtureRequest) -> Mapping[str, tuple[np.ndarray, np.ndarray]]:
    """Return every reading's values and standard deviations over all shots, on a quiet table ("") or on a floor."""
    found: dict[str, list[Quantity]] = {name: [] for name in TRUE}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pulse, "SMOOTH_HZ", (250.0,))
        for seed in range(SHOTS):
            rig = Synthetic(touch_s=0.012 + 1e-5 * float(np.random.default_rng(seed).uniform()))
            floor = Disturbance(criterion=request.param or None, seed=seed)
            motion = disturbed_motion(rig, floor, seed) if request.param else motion_of(rig, seed)
            for name, reading in _numbers(read_impact(replace(motion, moving_mass_u_kg=0.0))).items():
                if isinstance(reading, Quantity):
                    found[name].append(reading)
    return {name: (np.array([q.value for q in all_]), np.array([q.std for q in all_])) for name, all_ in found.items()}


@pytest.mark.parametrize("name", TRUE)
def test_a_reading_is_as_far_from_the_truth_as_its_uncertainty_says(
    seen: Mapping[str, tuple[np.ndarray, np.ndarray]], name: str
) -> None:
    values, stds = seen[name]
    assert values.size > 0.95 * SHOTS
    middle, true = float(np.median(values)), TRUE[name]
    assert true is None or abs(middle - true) < 0.75 * np.median(stds)
    # what a series or a fading force puts an instant off by is the same in every shot, and stands in the ± as well
    ratio = float(np.sqrt(np.mean(((values - (middle if true is None else true)) / stds) ** 2)))
    assert (0.6 if name == "contact_time_s" else 0.8) < ratio < 1.25


@pytest.mark.parametrize("share", [1e-2, 1e-3])
def test_what_is_not_known_of_the_mass_stands_in_force_and_slope_and_in_nothing_else(share: float) -> None:
    motion = replace(motion_of(Synthetic()), moving_mass_u_kg=0.0)
    known, unsure = (_numbers(read_impact(m)) for m in (motion, replace(motion, moving_mass_u_kg=share * MASS_KG)))
    for name, reading in known.items():
        carried = share * reading.value if name in ("force_peak_n", "stiffness_slope_n_per_m") else 0.0
        assert unsure[name].std == pytest.approx(np.hypot(reading.std, carried), rel=1e-9), name


def test_the_width_is_as_unsure_as_the_cut_off_that_could_have_been_chosen() -> None:
    """Against scipy's own low-pass, the half maximum crossed by straight lines; white noise is nothing beside it."""
    motion = motion_of(Synthetic())
    widths = []
    known = np.isfinite(motion.force_n)
    time_s, force = motion.time_s[known], motion.force_n[known]
    for cutoff_hz in (100.0, 250.0, 500.0):
        smooth = sosfiltfilt(butter(2, cutoff_hz, fs=motion.sample_rate_hz, output="sos"), force)
        above = np.flatnonzero(smooth > 0.5 * smooth.max())
        widths.append(time_s[above[-1]] - time_s[above[0]])
    width = read_impact(motion).force_fwhm_s
    assert isinstance(width, Quantity)
    assert width.value == pytest.approx(widths[1], abs=2e-5)
    assert width.std == pytest.approx((max(widths) - min(widths)) / np.sqrt(12.0), rel=0.15)


@pytest.mark.parametrize("shared", [-0.9, 0.0, 0.9])
def test_a_ratio_knows_what_both_velocities_share(shared: float) -> None:
    into_std, out_std, covariance = 3e-4, 4e-4, shared * 3e-4 * 4e-4
    spread = [[into_std**2, covariance], [covariance, out_std**2]]
    drawn = np.random.default_rng(2).multivariate_normal([-0.265, 0.2617], spread, 20_000)
    ratio = _ratio(Quantity(0.2617, out_std), Quantity(-0.265, into_std), covariance, "")
    assert ratio.std == pytest.approx(float(np.std(np.abs(drawn[:, 1] / drawn[:, 0]))), rel=0.03)


def test_a_disturbance_has_the_share_of_the_variance_that_white_noise_alone_would_not_leave() -> None:
    quiet = cast(Any, SimpleNamespace(plain=(3e-6, 9e-6)))
    into, out = Quantity(-0.265, 5e-6), Quantity(0.26, 8e-6)
    assert _shares(quiet, (into, out)) == pytest.approx({"velocity_in_m_per_s": 0.64, "velocity_out_m_per_s": 0.0})
    assert _shares(quiet, (into, Quantity(0.26, 0.0))) == pytest.approx({"velocity_in_m_per_s": 0.64})


def test_the_impulse_of_the_pulse_scatters_as_its_uncertainty_says_in_a_building() -> None:
    off = []
    for seed in range(25):
        rig = Synthetic(touch_s=0.012 + 1e-5 * float(np.random.default_rng(seed).uniform()))
        motion = disturbed_motion(rig, Disturbance(criterion="VC-C", seed=seed), seed)
        _, touch, release, quiet = _between_flights(motion)
        assert release is not None
        unknown = Quantity(0.0, 0.0), Quantity(0.0, 0.0)
        momentum = pulse.read_momentum(motion, touch, release, (0.0, 0.0), unknown, quiet.floor)
        assert momentum is not None
        off.append((momentum[0].value - MASS_KG * (0.265 + 0.261702343)) / momentum[0].std)
    assert 0.65 < float(np.sqrt(np.mean(np.square(off)))) < 1.35
