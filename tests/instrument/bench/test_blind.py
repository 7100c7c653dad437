"""Blind sets: the content of a record, the strength of an effect in it, and the best possible knowledge of it."""

from dataclasses import fields, replace

import numpy as np
import pytest

from analysis.inference.fit.shot_fit import fit_shots
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulation import demodulate
from analysis.signal.record import motion_from_displacement
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import record_shot
from tests.bench.blind import RATE_HZ, Record, clean_m, drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind, displacement_noise_m
from tests.bench.separation import separation
from tests.bench.strength import at_snr, base_tangents, cramer_rao, residual_snr


@pytest.fixture(scope="module")
def tilted():
    truth = drawn(["tilt"], 4)
    return truth, base_tangents(truth)


def test_a_record_tells_nothing_but_the_motion():
    names = {field.name for field in fields(Record)}
    assert names == {"time_s", "displacement_m", "noise_m", "moving_mass_kg", "wavelength_m"}
    truth = drawn(["coulomb_friction"], 1)
    shots = records(truth)
    assert len(shots) == 3 and all(shot.displacement_m.shape == shot.time_s.shape == (6000,) for shot in shots)
    again = records(truth)
    assert all(np.array_equal(a.displacement_m, b.displacement_m) for a, b in zip(shots, again, strict=True))


@pytest.mark.parametrize("names", [("coulomb_friction", "frame_vibration"), ("cyclic_error",)])
def test_the_fast_road_shows_what_the_optics_show(names):
    truth = replace(drawn(names, 5), speeds_m_per_s=(0.2,))
    rig = Bench(bodies=truth.bodies, effects=truth.effects, floor_m=0.0, seed=truth.seed)
    recording, _ = record_shot(rig, 0, 0.2, 10e6, 0.06)
    motion = demodulate(recording, AnalysisSettings())
    rest = motion.displacement_m - clean_m(truth, 0, time_s=motion.time_s)
    if names == ("cyclic_error",):  # in flight its line lies far outside a record's band, where filters differ
        line_hz = 2 * np.abs(motion.velocity_m_per_s) / 632.8e-9 * truth.effects["cyclic_error"]["order"]
        rest = rest[line_hz < 30e3]
        assert rest.size > 30
    else:
        rest = rest[20:-20]
    noise = displacement_noise_m(rig.optics, 10e6, RATE_HZ, both=False)
    assert np.std(rest) == pytest.approx(noise, rel=4 / np.sqrt(2 * rest.size))


@pytest.mark.parametrize("kind", list(NoiseKind))
def test_noise_has_its_colour(kind):
    noise = Noise(kind).draw(60_000, RATE_HZ, np.random.default_rng(2))
    power = np.abs(np.fft.rfft(noise * np.hanning(noise.size))) ** 2
    frequency = np.fft.rfftfreq(noise.size, 1 / RATE_HZ)

    def level(low, high):
        return power[(frequency > low) & (frequency < high)].mean()

    flat = level(3e3, 6e3)
    assert (level(30e3, 45e3) < 1e-3 * flat) == (kind is NoiseKind.LOW_PASSED)
    assert (level(5, 50) > 5 * flat) == (kind in (NoiseKind.DRIFTING, NoiseKind.FLOOR))
    if kind is not NoiseKind.LOW_PASSED:
        assert np.diff(noise).std() / np.sqrt(2) == pytest.approx(1e-10, rel=0.02)


def test_residual_grows_with_the_effect_and_is_nothing_without(tilted):
    truth, tangents = tilted
    weak, reached = at_snr(truth, 15.0, tangents)
    assert reached == pytest.approx(15.0, rel=0.05)
    twice = replace(weak, effects={"tilt": {"angle_rad": 2 * weak.effects["tilt"]["angle_rad"]}})
    assert residual_snr(twice, tangents) == pytest.approx(2 * reached, rel=0.02)
    assert residual_snr(replace(truth, effects={}), tangents) == 0.0


def test_a_change_of_the_base_is_no_effect(tilted):
    """A stiffer plate is swallowed by the base fit."""
    from tests.bench import strength

    truth, tangents = tilted
    plain = replace(truth, effects={})
    stiffness = plain.bodies.plate_stiffness_n_per_m * 1.01
    stiffer = replace(plain, bodies=replace(plain.bodies, plate_stiffness_n_per_m=stiffness))
    target = np.concatenate([clean_m(stiffer, i) for i in range(3)])
    at_start = np.linalg.norm(target - np.concatenate([clean_m(plain, i) for i in range(3)]))
    left = strength._base(plain, np.array([0, 0.01, *([0.0] * 11)])) - target
    assert np.linalg.norm(left) < 1e-9 * at_start
    projected = tangents.orthogonal.T @ (target - strength._base(plain, np.zeros(13)))
    assert np.linalg.norm(projected) == pytest.approx(at_start, rel=0.01)


def test_a_soft_clamp_that_the_plate_swallows_is_no_effect():
    """Its mode hardly rings, and its softness is the plate's: the base fit comes there over a worse one."""
    truth = replace(drawn(["support_compliance"], 2009388), noise=Noise(white_m=1e-10))
    assert truth.effects["support_compliance"]["compliance_m_per_n"] > 3e-5
    assert residual_snr(truth) < 5.0


def test_snr_and_the_best_possible_uncertainty_agree(tilted):
    """For one linear parameter the SNR is its value over the Cramer-Rao bound."""
    truth, tangents = tilted
    weak, reached = at_snr(truth, 20.0, tangents)
    bound = cramer_rao(weak, tangents)["tilt"]["angle_rad"]
    assert abs(weak.effects["tilt"]["angle_rad"]) / bound == pytest.approx(reached, rel=0.03)


def test_what_differs_from_shot_to_shot_has_no_bound():
    truth = drawn(["frame_vibration"], 2)
    assert set(cramer_rao(truth)["frame_vibration"]) == {"amplitude_m_per_s", "frequency_hz"}


@pytest.mark.slow
def test_a_look_alike_is_near_and_a_stranger_far():
    truth = drawn(["plate_damping"], 3)
    tangents = base_tangents(truth)
    weak, reached = at_snr(truth, 20.0, tangents)
    apart = separation(weak, tangents)
    assert len(apart) == 18 and "plate_damping" not in apart
    assert apart["viscoelastic_arm"] < 1.0  # a short relaxation is a dashpot
    assert apart["cyclic_error"] > 0.95 * reached and all(value <= reached * 1.01 for value in apart.values())


def test_a_look_alike_is_offered_its_own_reach():
    """A magnet is adhesion to within the noise, but at one reach only, which a coarse grid passes by."""
    truth = drawn(["magnet"], 1001787)
    weak, reached = at_snr(truth, 40.0)
    assert reached == pytest.approx(40.0, rel=0.05) and separation(weak, among=("adhesion",))["adhesion"] < 4.0


def test_a_soft_clamp_is_a_second_mode_of_a_softer_plate():
    """Not at its own frequency, but where it rings; and beside the base that was fitted, not beside the true one."""
    truth = replace(drawn(["support_compliance"], 3), noise=Noise(white_m=1e-10))
    soft = replace(truth, effects={"support_compliance": {"compliance_m_per_n": 1.9e-4, "frequency_hz": 2200.0}})
    assert residual_snr(soft) > 25.0
    assert separation(soft, among=("second_plate_mode",))["second_plate_mode"] < 2.0


def test_two_formulations_agree():
    """The analysis, which shares no code with this rig, fits its clean sets to the noise and finds the plate."""
    truth = drawn((), 6, Noise(white_m=1e-12))
    shown = []
    for record in records(truth):
        motion = motion_from_displacement(record.time_s, record.displacement_m, None, None, record.moving_mass_kg)
        shown.append(replace(motion, displacement_std_m=np.full(record.time_s.size, record.noise_m)))
    fit = fit_shots(shown)
    # chi^2 of so many samples, by a noise that is known from no more of them
    assert fit.converged and fit.reduced_chi2 == pytest.approx(1.0, abs=3 * np.sqrt(4 / fit.samples))
    for name in ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m"):
        assert fit.parameters[name].value == pytest.approx(getattr(truth.bodies, name), rel=1e-5)
