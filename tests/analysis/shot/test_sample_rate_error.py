"""What a wrong sample rate adds to each number: the power of time in it, by the motion that shows it."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from analysis.shot.fit import ShotFit
from analysis.shot.motion import BeatQuality
from analysis.shot.quantity import NotSeen, Quantity, power_of_time
from analysis.shot.recording import Channel, Recording, Role, Setup
from analysis.shot.sample_rate_error import (
    DELIVERED_KEY,
    _error_by_clock,
    _error_by_pd0,
    fit_with_rate_error,
    rate_error,
    velocity_offset_m_per_s,
    with_rate_error,
)
from tests.analysis.shots import PAPER_FIT, paper_impact
from tests.analysis.synthetic_collision import Synthetic, motion_from

TIME_S = np.arange(0.0, 0.01, 1e-5)
REST = Quantity(2.7e6, 1.0)
BEAT = BeatQuality(2.7e6, 0.4, 40.0, 0.0)
MOTION = replace(
    motion_from(TIME_S, -0.2 * TIME_S, Synthetic()), rate_error=0.01, reference=BEAT, rest_frequency_hz=REST
)
RECORDING = Recording("r", np.zeros((10, 1), np.int16), 1e7, (Channel(Role.MEASUREMENT, 1e-4),), Setup(0.018))


def by_rest(stated: float | None, u_hz: float | None, measured: Quantity | None) -> float:
    setup = replace(RECORDING.setup, rest_frequency_hz=stated, rest_frequency_u_hz=u_hz)
    return _error_by_pd0(replace(RECORDING, setup=setup), measured)


def test_pd0_contradicts_beyond_twice_both_uncertainties_or_half_a_thousandth() -> None:
    assert by_rest(None, None, REST) == by_rest(2.7e6, None, None) == by_rest(2.7e6, None, REST) == 0.0
    for off, u_hz, std, error in (
        (1340.0, None, 0.0, 0.0), (1360.0, None, 0.0, 1360.0), (-1360.0, None, 0.0, 1360.0),
        (9.9, 3.0, 4.0, 0.0), (10.1, 3.0, 4.0, 10.1), (1360.0, 0.0, 0.0, 1360.0), (2.7e7, 3.0, 0.0, 2.7e6),
    ):  # fmt: skip
        assert by_rest(2.7e6, u_hz, Quantity(2.7e6 + off, std)) == pytest.approx(error / 2.7e6), (off, u_hz)


@pytest.mark.parametrize(
    ("delivered", "error"),
    [(1.01e7, 0.01), (9.9e6, 0.01), (5e7, 1.0), (None, 0.0), (True, 0.0), ("x", 0.0), (math.nan, 1.0), (10**400, 1.0)],
)
def test_the_computers_clock_contradicts_by_what_it_says_of_the_rate(delivered: object, error: float) -> None:
    recording = replace(RECORDING, extra={"global": {DELIVERED_KEY: delivered}})
    assert _error_by_clock(recording) == pytest.approx(error)
    assert _error_by_clock(replace(RECORDING, extra={"global": 3})) == _error_by_clock(RECORDING) == 0.0
    setup = replace(RECORDING.setup, rest_frequency_hz=2.7e6)
    both = rate_error(replace(recording, setup=setup), Quantity(2.7e6 * 1.02, 0.0))
    assert both == pytest.approx(max(error, 0.02))


def test_with_pd0_velocities_forces_and_times_are_less_sure_by_their_powers_of_the_rate() -> None:
    impact = paper_impact()
    wider = with_rate_error(impact, MOTION)
    powers = {"velocity_in_m_per_s": 1, "velocity_out_m_per_s": 1, "force_peak_n": 2, "stiffness_slope_n_per_m": 2,
              "contact_time_s": 1, "force_fwhm_s": 1}  # fmt: skip
    for name in ("cor_quasi_static", "cor_impulse", "deflection_max_m", "touch_time_s", *powers):
        before, after = getattr(impact, name), getattr(wider, name)
        carried = 0.01 * powers.get(name, 0) * before.value
        assert after == replace(before, std=pytest.approx(math.hypot(before.std, carried), rel=1e-9)), name
    assert wider.cor_kinetic == impact.cor_kinetic
    assert with_rate_error(impact, replace(MOTION, rate_error=0.0)) is impact
    unseen = with_rate_error(replace(impact, force_peak_n=NotSeen("x")), MOTION)
    assert unseen.force_peak_n == NotSeen("x") and unseen.contact_time_s == wider.contact_time_s


def test_without_pd0_every_velocity_is_off_by_half_a_wavelength_of_the_rest_beats_shift() -> None:
    alone = replace(MOTION, reference=None)
    assert MOTION.wavelength_m is not None
    offset = velocity_offset_m_per_s(alone)
    assert offset == pytest.approx(0.5 * MOTION.wavelength_m * 2.7e6 * 0.01)
    for other in (MOTION, replace(alone, wavelength_m=None), replace(alone, rest_frequency_hz=NotSeen("x"))):
        assert velocity_offset_m_per_s(other) == 0.0
    impact = paper_impact()
    wider = with_rate_error(impact, alone)
    for name in ("velocity_in_m_per_s", "velocity_out_m_per_s"):
        before, after = getattr(impact, name), getattr(wider, name)
        assert after.std == pytest.approx(math.hypot(before.std, 0.01 * before.value, offset), rel=1e-9)
    deepest, lasts = impact.deflection_max_m, impact.contact_time_s
    assert isinstance(deepest, Quantity) and isinstance(lasts, Quantity)
    sheared = math.hypot(deepest.std, 0.5 * lasts.value * offset)  # for half of the contact
    assert wider.deflection_max_m == replace(deepest, std=pytest.approx(sheared))
    blind = with_rate_error(replace(impact, cor_impulse=NotSeen("x"), contact_time_s=NotSeen("y")), alone)
    assert (blind.cor_impulse, blind.deflection_max_m) == (NotSeen("x"), deepest)
    resting = with_rate_error(replace(impact, velocity_in_m_per_s=Quantity(0.0, 1e-6)), alone)
    assert resting.cor_quasi_static == impact.cor_quasi_static  # a ratio to nothing says nothing
    # both velocities move alike: (v_out + d) / (v_in + d)
    before, after = impact.cor_quasi_static, wider.cor_quasi_static
    assert isinstance(before, Quantity) and isinstance(after, Quantity)
    moved = abs((0.261702343 + 1e-6 * offset) / (-0.265 + 1e-6 * offset)) - 0.261702343 / 0.265
    assert after.std == pytest.approx(math.hypot(before.std, 1e6 * moved), rel=1e-3)


def test_a_fits_parameters_move_together_by_the_seconds_in_their_units() -> None:
    fit = fit_with_rate_error(PAPER_FIT, MOTION)
    moved = []
    for (name, before), after in zip(PAPER_FIT.parameters.items(), fit.parameters.values(), strict=True):
        moved.append(-0.01 * power_of_time(name) * before.value)
        assert after == replace(before, std=pytest.approx(math.hypot(before.std, moved[-1]), rel=1e-9))
    assert moved == pytest.approx([0.02 * 221.4, 0.0, 0.02 * 1e4, 0.01 * 0.4])
    assert fit.covariance == pytest.approx(PAPER_FIT.covariance + np.outer(moved, moved), rel=1e-12)
    assert fit_with_rate_error(PAPER_FIT, replace(MOTION, rate_error=0.0)) is PAPER_FIT
    bare = replace(PAPER_FIT, covariance=np.zeros((0, 0)))
    assert fit_with_rate_error(bare, MOTION).covariance.shape == (0, 0)


@pytest.mark.parametrize("reference", [BEAT, None])
def test_a_fits_velocities_take_the_rates_share_and_the_shift_of_the_rest_beat(reference: BeatQuality | None) -> None:
    motion = replace(MOTION, reference=reference)
    own = ShotFit(
        Quantity(-0.265, 3e-4), Quantity(0.26, 4e-4), Quantity(0.02, 1e-7), Quantity(0.0, 1e-9), cast(Any, None),
        cast(Any, None), 1.0,
    )  # fmt: skip
    (part,) = fit_with_rate_error(replace(PAPER_FIT, shots=(own,)), motion).shots
    offset = velocity_offset_m_per_s(motion)
    assert part.velocity_in_m_per_s.std == pytest.approx(math.hypot(3e-4, 0.00265, offset))
    assert part.velocity_out_m_per_s.std == pytest.approx(math.hypot(4e-4, 0.0026, offset))
    assert (part.touch_time_s, part.offset_m) == (own.touch_time_s, own.offset_m)
