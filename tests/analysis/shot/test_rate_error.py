"""A wrong sample rate is detected by PD0 or the computer's clock, and included in the uncertainties."""

import math
from dataclasses import replace

import pytest

from analysis.pipeline import analyse
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Recording, Role
from analysis.shot.sample_rate_error import (
    DELIVERED_KEY,
    RATE_CONTRADICTED,
    fit_with_rate_error,
    rate_error,
    velocity_offset_m_per_s,
    with_rate_error,
)
from analysis.shot.shot import AnalysisSettings, Shot
from analysis.signal.demodulation import demodulate
from analysis.uncertainty.gum_budget import budget
from tests.analysis.synthetic_collision import CONTACT_N_PER_M, DASHPOT, MASS_KG, PLATE_KG, PLATE_N_PER_M, Synthetic
from tests.beats import REST_HZ, recording_of

RIG = Synthetic()


def stating(rest_hz: float | None, rate: float = 1.0, u_hz: float | None = None) -> Recording:
    """Return a recording whose rest frequency and sample rate are stated so, the latter relative to the true one."""
    recording = recording_of(RIG)
    setup = replace(recording.setup, rest_frequency_hz=rest_hz, rest_frequency_u_hz=u_hz)
    return replace(recording, setup=setup, sample_rate_hz=rate * recording.sample_rate_hz)


@pytest.mark.parametrize(
    ("stated", "u_hz", "contradicted"),
    [
        (1.0, None, False),
        (1.0004, None, False),
        (1.0006, None, True),
        (1.011, None, True),
        (0.5, None, True),
        (1.001, 0.001 * REST_HZ, False),
        (1.0003, 0.0001 * REST_HZ, True),
    ],
)
def test_a_rate_is_flagged_where_pd0_contradicts_the_stated_rest_frequency(
    stated: float, u_hz: float | None, contradicted: bool
) -> None:
    recording = stating(stated * REST_HZ, u_hz=u_hz)
    assert (RATE_CONTRADICTED in demodulate(recording, AnalysisSettings()).flags) is contradicted


def held(reading: object, truth: float) -> bool:
    """Return whether a reading holds the truth within twice its uncertainty, which is not endless either."""
    assert isinstance(reading, Quantity)
    return abs(reading.value - truth) <= 2.0 * reading.std < 0.2 * abs(truth)


def check(shot: Shot) -> None:
    """Check that what the rate scales says how wrong it may be, and what it does not stays as sharp as it was."""
    right = analyse(stating(REST_HZ), AnalysisSettings(fit=False)).impact
    impact = shot.impact
    assert right is not None and impact is not None and RATE_CONTRADICTED in shot.flags
    assert held(impact.velocity_in_m_per_s, -RIG.speed_m_per_s)
    for name in ("velocity_out_m_per_s", "force_peak_n", "contact_time_s", "force_fwhm_s", "stiffness_slope_n_per_m"):
        truth = getattr(right, name)
        assert isinstance(truth, Quantity) and held(getattr(impact, name), truth.value), name


def test_a_rate_wrong_by_a_percent_is_part_of_the_uncertainties() -> None:
    shot = analyse(stating(REST_HZ, rate=1.01), AnalysisSettings(fit=False))
    check(shot)
    impact = shot.impact
    assert impact is not None and isinstance(impact.cor_quasi_static, Quantity)
    assert impact.cor_quasi_static.std < 1e-3  # a ratio knows no rate
    assert isinstance(impact.deflection_max_m, Quantity) and impact.deflection_max_m.std < 1e-6  # nor does a length
    found = budget(shot).of("velocity_in_m_per_s")
    assert found is not None and found.std == pytest.approx(0.01 * abs(found.value), rel=0.05)
    assert found.rows[0].source == "timebase" and found.std_a < 1e-3 * abs(found.value)


@pytest.mark.parametrize("rate", [0.99, 1.03])
def test_the_clock_contradicts_as_pd0_does(rate: float) -> None:
    recording = stating(None, rate=rate)
    truth_hz = recording.sample_rate_hz / rate
    check(analyse(replace(recording, extra={"global": {DELIVERED_KEY: truth_hz}}), AnalysisSettings(fit=False)))


def test_without_pd0_a_wrong_rate_adds_to_every_velocity() -> None:
    recording = stating(REST_HZ, rate=1.002)
    columns = [k for k, channel in enumerate(recording.channels) if channel.role is not Role.REFERENCE]
    counts = recording.counts[:, columns].copy()
    counts.flags.writeable = False
    alone = replace(recording, counts=counts, channels=tuple(recording.channels[k] for k in columns))
    alone = replace(alone, extra={"global": {DELIVERED_KEY: recording.sample_rate_hz / 1.002}})
    impact = analyse(alone, AnalysisSettings(fit=False)).impact
    right = analyse(stating(REST_HZ), AnalysisSettings(fit=False)).impact
    assert impact is not None and right is not None
    for name in ("velocity_in_m_per_s", "velocity_out_m_per_s", "cor_quasi_static", "deflection_max_m"):
        truth, read = getattr(right, name), getattr(impact, name)
        assert abs(read.value - truth.value) <= 2.0 * read.std < 0.2 * abs(truth.value), name


def test_fitted_parameters_scale_with_the_powers_of_time_in_their_units() -> None:
    shot = analyse(stating(REST_HZ, rate=1.01))
    assert shot.fit is not None and shot.fit.converged
    truth = (PLATE_N_PER_M, PLATE_KG, CONTACT_N_PER_M, DASHPOT)
    names = ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m")
    for name, true, power in zip(names, truth, (2, 0, 2, 1), strict=True):
        found = shot.fit.parameters[name]
        assert found.std >= 0.99 * 0.01 * power * found.value
        assert abs(found.value - true) < 3.0 * found.std, name
    contact = shot.impact.cor_kinetic.contact if shot.impact else None
    assert isinstance(contact, Quantity) and contact.std < 1e-3
    assert shot.motion is not None and shot.motion.moving_mass_kg == MASS_KG
    assert fit_with_rate_error(shot.fit, replace(shot.motion, rate_error=0.0)) is shot.fit


@pytest.mark.parametrize(
    ("measured", "std", "u_hz", "error"),
    [
        (1.00049, 0.0, None, 0.0),
        (1.00051, 0.0, None, 0.00051),
        (0.99949, 0.0, None, 0.00051),
        (1.00051, 1e-4, None, 0.0),  # twice its own uncertainty beside the 500 ppm
        (1.0019, 0.0, 1e-3, 0.0),  # stated to 1000 ppm: twice that
        (1.0021, 0.0, 1e-3, 0.0021),
        (3.0, 0.0, None, 1.0),
    ],
)
def test_pd0_contradicts_beyond_twice_the_joint_uncertainty(
    measured: float, std: float, u_hz: float | None, error: float
) -> None:
    recording = stating(REST_HZ, u_hz=None if u_hz is None else u_hz * REST_HZ)
    found = rate_error(recording, Quantity(measured * REST_HZ, std * REST_HZ))
    assert found == pytest.approx(error, abs=1e-9)
    assert rate_error(recording, None) == 0.0 == rate_error(stating(None), Quantity(measured * REST_HZ, 0.0))


@pytest.mark.parametrize(
    ("delivered", "error"),
    [
        (1.01, 0.01),
        (0.97, 0.03),
        (3.0, 1.0),
        (True, 0.0),
        ("fast", 0.0),
        (None, 0.0),
        (10**400, 1.0),
        (float("nan"), 1.0),
    ],
)
def test_the_clock_is_a_number_or_says_nothing_and_the_larger_error_counts(delivered: object, error: float) -> None:
    recording = stating(REST_HZ)
    told = delivered * recording.sample_rate_hz if isinstance(delivered, float) else delivered
    recording = replace(recording, extra={"global": {DELIVERED_KEY: told}})
    assert rate_error(recording, None) == pytest.approx(error)
    assert rate_error(recording, Quantity(1.02 * REST_HZ, 0.0)) == pytest.approx(max(error, 0.02))
    assert rate_error(replace(recording, extra={"global": [1]}), None) == 0.0


def test_each_reading_is_wider_by_the_power_of_the_rate_that_it_goes_with() -> None:
    shot = analyse(stating(REST_HZ), AnalysisSettings(fit=False))
    assert shot.impact is not None and shot.motion is not None
    motion = replace(shot.motion, rate_error=0.01)
    wide = with_rate_error(shot.impact, motion)
    powers = {
        "velocity_in_m_per_s": 1, "velocity_out_m_per_s": 1, "force_peak_n": 2, "stiffness_slope_n_per_m": 2,
        "contact_time_s": 1, "force_fwhm_s": 1, "cor_quasi_static": 0, "cor_impulse": 0, "deflection_max_m": 0,
    }  # fmt: skip
    for name, power in powers.items():
        before, after = getattr(shot.impact, name), getattr(wide, name)
        assert after.value == before.value
        assert after.std**2 - before.std**2 == pytest.approx((power * 0.01 * before.value) ** 2, rel=1e-9, abs=1e-30), (
            name
        )
    assert with_rate_error(shot.impact, shot.motion) is shot.impact
    # where the rest frequency was stated, one velocity is added to both flights
    alone = replace(motion, reference=None, rest_frequency_hz=Quantity(REST_HZ, 0.0))
    moved = 0.5 * (motion.wavelength_m or 0.0) * REST_HZ * 0.01
    assert velocity_offset_m_per_s(alone) == pytest.approx(moved) and velocity_offset_m_per_s(motion) == 0.0
    wider = with_rate_error(shot.impact, alone)
    into, cor, lasts = shot.impact.velocity_in_m_per_s, shot.impact.cor_quasi_static, shot.impact.contact_time_s
    assert isinstance(into, Quantity) and isinstance(cor, Quantity) and isinstance(lasts, Quantity)
    for name, added in (
        ("velocity_in_m_per_s", math.hypot(0.01 * into.value, moved)),
        ("cor_quasi_static", (1 + cor.value) * moved / abs(into.value)),
        ("deflection_max_m", 0.5 * lasts.value * moved),
    ):
        before, after = getattr(shot.impact, name), getattr(wider, name)
        assert after.std == pytest.approx(math.hypot(before.std, added), rel=1e-9, abs=0.0), name
