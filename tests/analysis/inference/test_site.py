"""The diagnosis knows the site: one spectrum of all shots, weighed wherever displacements are whitened."""

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.cross_validation import predict
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Verdict
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.joint.joint_data import (
    frame_motions_of,
    joint_data,
)
from analysis.inference.model.base import base_named, start_from_fit
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise import estimate
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.site import STILL_FRAME, site_under
from analysis.inference.noise.sway import Sway, frame_response_of, with_plates
from analysis.pipeline import analyse
from analysis.reading.read import read_frame_motion
from analysis.shot import plate_count
from analysis.shot.impact import VibrationSpectrum
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisSettings
from instrument.bench.effects import Effects
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import record_shot
from instrument.bench.site import site_named
from tests.analysis.diagnosis.shots import KINDS, WHITE_M, calm, motions_of
from tests.analysis.synthetic_collision import Synthetic, motion_from
from tests.bench.blind import drawn
from tests.bench.displacement_noise import Noise, NoiseKind
from tests.building_rig import Rig


def shots_at(site: str, seed: int, effects: Effects | None = None):
    truth = drawn((), seed, Noise(NoiseKind.WHITE, white_m=WHITE_M), 3, site_named(site))
    return motions_of(replace(truth, effects=effects or {}))


def a_sway(random: np.random.Generator, rows: int = 60) -> Sway:
    """Return two bands of motion, far above noise of 1 and near it."""
    columns = random.standard_normal((rows, 9)) * np.repeat([30.0, 1.0], [5, 4])
    basis, _ = np.linalg.qr(columns)
    return Sway(basis, basis.T @ columns, np.repeat([0, 1], [5, 4]), np.ones(rows, np.bool_))


def a_noise(white_m: float, strengths: tuple[float, ...], wander_m: float = 0.0) -> Floor:
    """Return white noise with a part that wanders and a site."""
    return Floor(white_m, (wander_m, 0.0), (1e-3, 1e-2), 5e-5, strengths)


def covariance_of(noise: Floor, rows: int) -> np.ndarray:
    """Return what ``noise`` is without its site, written down."""
    apart = np.abs(np.subtract.outer(np.arange(rows), np.arange(rows))) * noise.spacing_s
    return noise.white_m**2 * np.eye(rows) + noise.rms_m[0] ** 2 * np.exp(-apart / noise.tau_s[0])


@pytest.mark.parametrize("wander_m", [0.0, 2.0])
@pytest.mark.parametrize(("white_m", "strengths"), [(1.0, (0.0, 0.0)), (0.3, (-2.0, 1.5))])
def test_whitening_undoes_noise_wander_and_sway(
    white_m: float, strengths: tuple[float, float], wander_m: float
) -> None:
    sway = a_sway(np.random.default_rng(1))
    noise = a_noise(white_m, strengths, wander_m)
    moved = sway.basis @ sway.factors * np.exp(0.5 * np.array(strengths))[sway.band]
    root = np.linalg.cholesky(moved @ moved.T + covariance_of(noise, 60))
    white = sway.whiten(noise.whiten(root, sway.valid), noise)
    np.testing.assert_allclose(white @ white.T, np.eye(60), atol=1e-8)


@pytest.mark.parametrize("wander_m", [0.0, 2.0])
def test_what_the_site_likely_did_is_the_conditional_mean(wander_m: float) -> None:
    sway, noise = a_sway(np.random.default_rng(2)), a_noise(0.3, (0.0, 0.0), wander_m)
    moved = sway.basis @ sway.factors
    left = np.random.default_rng(3).standard_normal(60)
    expected = moved @ moved.T @ np.linalg.solve(moved @ moved.T + covariance_of(noise, 60), left)
    np.testing.assert_allclose(sway.likely(left, noise), expected, atol=1e-10)


@pytest.mark.parametrize("wander_m", [0.0, 2.0])
def test_the_likeliest_plate_is_the_conditional_mean_wherever_it_was_taken_to_be(wander_m: float) -> None:
    random = np.random.default_rng(4)
    columns = random.standard_normal((60, 9)) * np.repeat([30.0, 5.0], [7, 2])
    basis, _ = np.linalg.qr(columns)
    valid = np.ones(60, np.bool_)
    sway = Sway(basis, basis.T @ columns, np.repeat([0, 1], [7, 2]), valid, plate_std=(2e-7, 1e-4))
    strengths = (0.4, -1.0)
    noise = a_noise(0.3, strengths, wander_m)
    sizes = np.exp(0.5 * np.array(strengths))[sway.band]
    moved, left = columns * sizes, random.standard_normal(60)
    numbers = moved.T @ np.linalg.solve(moved @ moved.T + covariance_of(noise, 60), left)
    expected = (numbers * sizes)[-2:] * sway.plate_std
    np.testing.assert_allclose(sway.likeliest_plate(left, noise), expected, rtol=1e-6)
    known = (3e-7, -2e-4)  # what it does is taken off the remainder then
    beside = left - columns[:, -2:] @ np.divide(known, sway.plate_std)
    np.testing.assert_allclose(beside + sway.plate_displacement_m(known), left, atol=1e-9)


RECORDS: Any = [SimpleNamespace(time_s=np.array([0.0, end])) for end in (0.05, 0.06)]


def flat(power_m2: float, lines: tuple[tuple[float, float], ...] = ()) -> VibrationSpectrum:
    frequency = np.arange(2.0, 400.0, 4.0)
    at, size = (np.array(column) for column in zip(*lines, strict=True)) if lines else (np.zeros(0), np.zeros(0))
    random = np.arange(frequency.size + at.size) < frequency.size
    power = np.concatenate([np.full(frequency.size, power_m2), size])
    return VibrationSpectrum(np.concatenate([frequency, at]), power, random)


def test_what_falls_no_faster_than_a_path_wanders_is_none_of_the_frames() -> None:
    frequency = np.arange(2.0, 1000.0, 4.0)
    of_frame, of_path = 1e-15 * (frequency / 10.0) ** -5.0, 1e-19 * (frequency / 10.0) ** -2.0
    spectrum = VibrationSpectrum(frequency, of_frame + of_path, np.ones(frequency.size, np.bool_))
    site = site_under(RECORDS, (spectrum,), CRITERIA.site_nm)
    assert site.moves
    both = 2.0 * 1e-19 / 1e-15  # of path over frame: where all is three times the path
    fastest = 10.0 * both ** (-1 / 3)
    assert site.vibration.frequency_hz[-1] == pytest.approx(fastest, rel=0.05)


def test_a_line_of_several_shots_is_one_and_the_floor_is_their_mean() -> None:
    one, other = flat(1e-16, ((100.0, 4e-18),)), flat(3e-16, ((101.0, 2e-18), (296.0, 1e-18)))
    site = site_under(RECORDS, (one, other), CRITERIA.site_nm)
    assert site.moves
    lines = site.vibration.frequency_hz[~site.vibration.random]
    assert list(lines) == [100.0, 101.0, 296.0]
    assert list(site.band[~site.vibration.random] - site.random_bands) == [0, 0, 1]
    assert site.vibration.power_m2[~site.vibration.random] == pytest.approx([2e-18, 1e-18, 0.5e-18])
    assert site.vibration.density_m2_per_hz(200.0) == pytest.approx(2e-16 / 4.0, rel=0.02)
    # sines closer than one over the record stand for random motion, in bands of a third of an octave
    sines = site.vibration.frequency_hz[site.vibration.random]
    np.testing.assert_allclose(sines, 0.45 / 0.06 * (0.25 + np.arange(sines.size)))
    assert 0.45 / 0.06 > 296.0 - sines[-1] > 0.0 and site.bands == site.random_bands + 2
    thirds = np.floor(3.0 * np.log2(sines[1:] / sines[1]))
    np.testing.assert_array_equal(np.diff(site.band[: sines.size])[1:] > 0, np.diff(thirds) > 0)
    assert site.band[:2].tolist() == [0, 0] and site.random_bands == np.unique(thirds).size
    assert site_under(RECORDS, (one, None), CRITERIA.site_nm).vibration.power_m2[-1] == pytest.approx(2e-18)
    assert site.moves and site.resembles(effect_named("frame_vibration")) and not site.resembles(effect_named("tilt"))


def test_a_still_frame_has_no_bands_and_resembles_no_effect() -> None:
    assert not STILL_FRAME.moves and STILL_FRAME.bands == STILL_FRAME.random_bands == 0
    assert not any(STILL_FRAME.resembles(effect_named(name)) for name in ("frame_vibration", "plate_motion", "tilt"))


@pytest.mark.parametrize(("whole", "sines"), [(False, 50), (True, 100)])
def test_all_motion_is_the_frames_where_that_is_supposed(whole: bool, sines: int) -> None:
    """A path's density falls with the square of the frequency: above its knee the motion is not the frame's."""
    frequency = 0.45 / 0.06 * (0.25 + np.arange(100))
    level = np.where(np.arange(100) < 50, 3.1, 1.0) * 1e-13
    vibration = VibrationSpectrum(frequency, level / frequency**2, np.ones(100, bool))
    found = site_under(RECORDS, (vibration,), 0.0, whole=whole)
    assert found is not None and abs(found.vibration.frequency_hz.size - sines) <= 1


def test_a_quiet_table_is_no_site() -> None:
    assert site_under(RECORDS, (None, None), CRITERIA.site_nm) is STILL_FRAME
    assert site_under(RECORDS, (flat(1e-18), flat(2e-18)), CRITERIA.site_nm) is STILL_FRAME  # 12 nm: a path wanders so
    assert (
        site_under(RECORDS, (flat(1e-22, ((100.0, 1e-15),)),), CRITERIA.site_nm) is STILL_FRAME
    )  # the diagnosis tells


@cache
def problem_at_vc_d() -> tuple[Problem, np.ndarray]:
    """Return three clean shots at VC-D as a diagnosis judges them, and the vector of the base fit."""
    motions = shots_at("VC-D", 31)
    vibrations = frame_motions_of(motions, "paper", None)
    site = site_under(motions, vibrations, CRITERIA.site_nm)
    fit = fit_shots(motions, vibrations=vibrations)
    begin = start_from_fit(fit, motions)
    data = joint_data(averaged_shots(motions), begin, site)
    problem = Problem(data, (), data.white_noise)
    return problem, problem.pack(Point(begin.shared, begin.own, ({},) * 3))


def at_vc_d():
    """Return these shots, and what the base fit leaves."""
    problem, z = problem_at_vc_d()
    return problem.data, problem.residual_m(z)


def test_how_far_a_held_out_shot_lies_off_is_not_how_far_the_building_moved_it() -> None:
    """An effect of a nanometre was refused where the frame's 150 nm hid that it predicts better."""
    problem, z = problem_at_vc_d()
    fitted = problem.with_start_noise(z).fit(z)
    told = predict(fitted, (1,), fitted.noise, calm)
    assert told is not None
    held = problem.data.shots[1]
    raw = (held.displacement_m - held.averaged(told.displacement_m[0]))[held.valid]
    assert told.rms_m < 1.2 * fitted.noise.white_m < 0.01 * float(np.sqrt(np.mean(raw**2)))


def test_strengths_are_the_likeliest_and_leave_white_noise() -> None:
    data, left = at_vc_d()
    floor, value = estimate.learn(left, data.shots, data.site)
    assert floor.white_m == pytest.approx(WHITE_M / math.sqrt(data.shots[0].factor), rel=0.05)
    for shot, rest in zip(data.shots, left, strict=True):
        white = shot.whitened(floor, rest[:, None])[:, 0]
        assert np.mean(white**2) == pytest.approx(1.0, abs=0.12)
    for scale in (0.9, 1.1):
        other = replace(floor, white_m=scale * floor.white_m)
        assert estimate.learn(left, data.shots, data.site, start=other)[1] == pytest.approx(value, abs=0.05)


def test_a_plate_known_to_swing_moves_as_the_effect_does() -> None:
    data, _ = at_vc_d()
    own = np.array([[s.course.velocity_in_m_per_s, s.course.touch_time_s, 0.0] for s in data.shots])
    base = np.array([220.0, 1.7e-4, 1.2e4, 0.4])
    swing = {"displacement_m": 3e-7, "velocity_m_per_s": -4e-4}
    still = replace(data, shots=with_plates(data.shots, ((0.0, 0.0),) * 3))
    moving = replace(data, shots=with_plates(data.shots, (tuple(swing.values()),) * 3))
    as_known, as_effect = Point(base, own, ({},) * 3), Point(base, own, ({effect_named("plate_motion"): swing},) * 3)
    noise = data.white_noise
    known, effect = Problem(moving, (), noise), Problem(still, (KINDS["plate_motion"],), noise)
    np.testing.assert_allclose(known.averaged(0, as_known), effect.averaged(0, as_effect), atol=1e-15)
    np.testing.assert_allclose(known.coarse(0, as_known), effect.coarse(0, as_effect), atol=1e-15)
    assert np.abs(known.averaged(0, as_known) - Problem(still, (), noise).averaged(0, as_known)).max() > 1e-8


@pytest.mark.parametrize(("site", "seed"), [pytest.param("VC-B", 209, marks=pytest.mark.slow), ("VC-A", 226)])
def test_a_joint_fit_in_a_building_is_not_drawn_to_other_bounces(site: str, seed: int) -> None:
    """A swaying frame lets a first guess pass whose bounces are not the shots': from there no step leads back."""
    motions = shots_at(site, seed)
    fit = fit_shots(motions, vibrations=frame_motions_of(motions, "paper", None))
    assert fit.reduced_chi2 < 1.2


def test_nobody_says_what_a_frame_does_where_nothing_collides() -> None:
    motions = shots_at("VC-D", 31)
    fit = fit_shots(motions)
    names = {"plate_stiffness_n_per_m": 3.8e6, "plate_mass_kg": 1.4e-6, "contact_stiffness_n_per_m": 280.0}
    drawn_off = replace(fit, parameters={**fit.parameters, **{name: Quantity(v, 0.0) for name, v in names.items()}})
    site = site_under(motions, frame_motions_of(motions, "paper", None), CRITERIA.site_nm)
    assert site.moves
    assert joint_data(averaged_shots(motions), start_from_fit(drawn_off, motions), site).site is STILL_FRAME


@pytest.mark.slow  # quicker: friction alone is named there, below
def test_a_clean_set_in_an_ordinary_building_is_adequate() -> None:
    diagnosis = diagnose(shots_at("VC-D", 31))
    assert diagnosis.verdict is Verdict.ADEQUATE
    for shot in diagnosis.fit_after.shots:  # a speed in space is known no better than the frame's
        assert shot.velocity_in_m_per_s.std > 2e-6
    assert not {"frame_vibration", "plate_motion"} & {
        candidate.name for candidate in diagnosis.candidates
    }  # the site's


def test_friction_is_named_in_an_ordinary_building() -> None:
    diagnosis = diagnose(shots_at("VC-D", 31, {"coulomb_friction": {"force_n": 1e-3}}))
    assert diagnosis.verdict is Verdict.EFFECT_FOUND
    assert [effect.name for effect in diagnosis.effects] == ["coulomb_friction"]
    force = diagnosis.effects[0].parameters["force_n"]
    assert abs(force.value - 1e-3) < 4 * force.std
    assert force.std < 5e-6


def test_directions_are_orthonormal_where_a_frame_moves_a_million_times_the_noise() -> None:
    motions = Rig("VC-A").shots(40, (0.265,))
    site = site_under(motions, frame_motions_of(motions, "paper", None), CRITERIA.site_nm)
    assert site.moves
    (shot,) = averaged_shots(motions)
    base, shared = base_named("paper").on_plates(plate_count(motions)), np.array([221.4, 1.984e-4, 1e4, 0.4])
    sway = frame_response_of(shot, site, base, shared, np.array(shot.course.own), {})
    for wander_m in (0.0, shot.white_m):
        noise = a_noise(shot.white_m, (0.0,) * site.bands, wander_m)
        known = sway.whitened_directions(noise)
        basis = np.linalg.solve(known.root.T, known.columns.T).T
        assert np.abs(basis.T @ basis - np.eye(basis.shape[1])).max() < 1e-12


@pytest.mark.parametrize("share", [1e-9, 0.0])
def test_a_frame_that_nothing_feels_takes_nothing(share: float, capfd: pytest.CaptureFixture[str]) -> None:
    motions = Rig("VC-A").shots(40, (0.265,))
    site = site_under(motions, frame_motions_of(motions, "paper", None), CRITERIA.site_nm)
    assert site.moves
    still = replace(site, vibration=replace(site.vibration, power_m2=site.vibration.power_m2 * share**2))
    (shot,) = averaged_shots(motions)
    base, shared = base_named("paper").on_plates(plate_count(motions)), np.array([221.4, 1.984e-4, 1e4, 0.4])
    sway = frame_response_of(shot, still, base, shared, np.array(shot.course.own), {})
    noise = a_noise(shot.white_m, (0.0,) * site.bands)
    rows = np.random.default_rng(1).standard_normal((int(shot.valid.sum()), 2))
    most = np.linalg.norm(sway.scaled(noise), 2) ** 2  # of the variance: a plate is never taken to be at rest
    assert most < 1e-4
    np.testing.assert_allclose(sway.whiten(rows, noise), rows, atol=most)
    left_m = np.full(shot.valid.size, shot.white_m)
    assert np.linalg.norm(sway.likely(left_m, noise)) < most * np.linalg.norm(left_m)
    assert capfd.readouterr().err == ""  # LAPACK writes there what it is refused


def test_a_fit_with_an_effect_takes_the_plate_to_stand_where_it_does_with_the_effect() -> None:
    """Without the drag the plate seems to swing by half a micrometre; the residual stood so far off at the touch."""
    rig = Bench(effects={"quadratic_drag": {"coefficient_n_s2_per_m2": 3e-3}}, site=site_named("VC-D"), seed=71)
    recording, _ = record_shot(rig, 4, 0.404, 10e6, 0.15)
    motion = analyse(recording, AnalysisSettings(fit=False)).motion
    assert motion is not None
    shot = fit_shots([motion], effects=["quadratic_drag"], vibrations=[read_frame_motion(motion)]).shots[0]
    assert shot.sway_std_m is not None
    near = np.abs(motion.time_s - shot.touch_time_s.value) < 1e-3
    off = shot.residual_m[near] / shot.sway_std_m[near]
    assert float(np.sqrt(np.mean(off**2))) < 2.0


@pytest.mark.parametrize(("rate_hz", "separates"), [(9.9e3, False), (10e3, True)])
def test_a_frames_motion_up_to_1_khz_is_told_from_noise_where_a_period_has_ten_samples(
    rate_hz: float, separates: bool
) -> None:
    rig = Synthetic(rate_hz=rate_hz, bandwidth_hz=0.1 * rate_hz)
    time_s = np.arange(0.0, 0.01, 1.0 / rate_hz)
    motion, known = motion_from(time_s, np.zeros(time_s.size), rig), flat(1e-18)
    assert frame_motions_of([motion], "paper", [known]) == ((known if separates else None),)
