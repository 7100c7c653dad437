"""The band about a residual is as wide as the noise and vibration in it."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.pipeline import analyse_motion
from analysis.shot.impact import VibrationSpectrum
from analysis.shot.shot import AnalysisSettings
from analysis.uncertainty.noise_band import diagnosis_band, noise_band_of_motion, noise_band_of_shot, verdict_band
from app.report.exports import motion_columns
from app.session.load import load_and_analyse
from instrument.bench.simulated_shots import simulate
from instrument.bench.site import USUAL_SITE, site_named
from tests.app import synthetic
from tests.building_rig import Rig


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    (path,) = simulate(tmp_path_factory.mktemp("usual"), 1, 3, site=site_named(USUAL_SITE))
    return load_and_analyse(path)


def test_on_a_usual_floor_force_and_velocity_fill_their_bands(shot):
    motion, overlay = shot.motion, shot.fit.shots[0].overlay
    band = noise_band_of_shot(shot)
    for left, std in (
        (motion.force_n - overlay.force_n, band.force_n),
        (motion.velocity_m_per_s - overlay.velocity_m_per_s, band.velocity_m_per_s),
        (shot.fit.shots[0].residual_m, band.displacement_m),
    ):
        seen = np.isfinite(left) & np.isfinite(std)
        size = float(np.sqrt(np.mean((left[seen] / std[seen]) ** 2)))
        assert 0.5 < size < 2.0  # a slow floor is seen for few of its periods
    force = motion.force_n - overlay.force_n
    assert float(np.nanstd(force) / np.nanmedian(band.force_n)) == pytest.approx(1.0, abs=0.15)
    assert np.nanmedian(motion.force_std_n) > 3 * np.nanmedian(band.force_n)  # a random walk has more of high tones


@pytest.mark.parametrize("site", ["VC-B", "VC-D", "VC-F"])
def test_force_fills_its_band_where_the_path_wanders_beside_the_building(site):
    """Air moves any path: without its wander the band of the force was a quarter to a half too narrow."""
    for motion in Rig(site).shots(6, (0.22, 0.3)):
        shot = analyse_motion(motion, AnalysisSettings(), name="rig")
        assert shot.fit.wander
        band, overlay = noise_band_of_shot(shot), shot.fit.shots[0].overlay
        left = (motion.force_n - overlay.force_n) / band.force_n
        left = left[np.isfinite(left)]
        assert np.sqrt(np.mean(left**2)) == pytest.approx(1.0, abs=0.1)
        columns = motion_columns(shot)
        assert columns["force_std_n"][motion.valid] == pytest.approx(band.force_n[motion.valid], nan_ok=True)


def test_the_residual_of_a_slow_floor_stays_inside_its_band(tmp_path):
    """A fit that weighs the floor holds on to the contact: the ends of the record stray, and the band knows it."""
    (path,) = simulate(tmp_path, 1, 24, site=site_named("VC-D"))
    strayed = load_and_analyse(path)
    assert strayed.fit.on_frames
    left, std = strayed.fit.shots[0].residual_m, noise_band_of_shot(strayed).displacement_m
    seen = np.isfinite(left)
    inside = np.abs(left[seen]) < 2.0 * std[seen]
    assert inside.mean() > 0.95  # place and speed chosen freely leave 0.62 of them inside
    assert np.sqrt(np.mean((left[seen] / std[seen]) ** 2)) > 0.5  # and no wider than it must be
    ends, middle = std[seen][[0, -1]], np.min(std[seen])
    assert (ends > 2.0 * middle).all()


def test_a_steady_line_is_in_the_band_with_its_own_velocity_and_force():
    motion = synthetic.shot().motion
    line = VibrationSpectrum(np.array([100.0]), np.array([(5e-9) ** 2]), np.array([False]))
    quiet, shaken = (
        noise_band_of_motion(motion, VibrationSpectrum(*(np.empty(0),) * 3)),
        noise_band_of_motion(motion, line),
    )
    for name, turns in (("displacement_m", 0), ("velocity_m_per_s", 1), ("force_n", 2)):
        more = np.sqrt(getattr(shaken, name) ** 2 - getattr(quiet, name) ** 2)
        mass = motion.moving_mass_kg if name == "force_n" else 1.0
        assert np.nanmedian(more) == pytest.approx(mass * 5e-9 * (2 * np.pi * 100.0) ** turns, rel=1e-3)


def test_without_a_spectrum_of_the_path_the_band_is_the_motions_own():
    motion = synthetic.shot().motion
    assert noise_band_of_motion(motion, None).force_n is motion.force_std_n


def test_a_path_that_wanders_is_in_the_band_of_the_displacement(tmp_path):
    """The band was the samples' white noise: the residual of a shot without a fault left it for twenty ms on end."""
    (path,) = simulate(tmp_path, 1)
    calm = load_and_analyse(path)
    left = calm.fit.shots[0].residual_m
    seen = np.isfinite(left)
    assert np.sqrt(np.mean(left[seen] ** 2)) > 1.5 * np.nanmedian(calm.motion.displacement_std_m)  # it does wander
    inside = np.abs(left[seen]) < 2.0 * noise_band_of_shot(calm).displacement_m[seen]
    assert inside.mean() > 0.95


@pytest.mark.parametrize(
    ("verdict", "times", "learnt"),
    [
        (Verdict.ADEQUATE, 3.0, True),
        (Verdict.EFFECT_FOUND, 3.0, True),
        (Verdict.PARTLY_EXPLAINED, 3.0, False),  # what is left over might pass for a path that wanders
        (Verdict.UNEXPLAINED, 3.0, False),
        (Verdict.ADEQUATE, 1.05, False),  # no more than the samples' own
    ],
)
def test_the_noise_that_a_diagnosis_learnt_is_drawn_where_it_explained_its_shots(verdict, times, learnt):
    shot = synthetic.shot()
    white_m = float(np.nanmedian(shot.motion.displacement_std_m))
    found = synthetic.diagnosis(shot)
    found = replace(found, verdict=verdict, fit_after=replace(found.fit_after, noise_std_m=times * white_m))
    shown, words = diagnosis_band(found, shot)
    if learnt:
        assert shown == pytest.approx(times * white_m) and words == "noise, from all shots"
    else:
        assert (
            shown == pytest.approx(noise_band_of_shot(shot).displacement_m, nan_ok=True)
            and words == "noise and floor vibration"
        )
    band, said = verdict_band(shot, found)
    assert said == words and band.displacement_m == pytest.approx(shown, nan_ok=True)
    assert band.force_n == pytest.approx(noise_band_of_shot(shot).force_n, nan_ok=True)


def test_what_a_diagnosis_leaves_in_a_building_stays_inside_the_band_it_was_judged_by():
    """Under "adequate" stood a residual of a micrometre about a band of a nanometre."""
    motions = Rig("VC-D").shots(11, (0.2, 0.33))
    shots = [analyse_motion(motion, AnalysisSettings(), name="rig") for motion in motions]
    found = diagnose(motions)
    assert found.verdict is Verdict.ADEQUATE
    inside, off = [], []
    for shot, part in zip(shots, found.fit_after.shots, strict=True):
        band, words = diagnosis_band(found, shot)
        assert "floor vibration" in words
        assert np.array_equal(band, np.hypot(found.fit_after.noise_std_m, part.sway_std_m), equal_nan=True)
        seen = np.isfinite(part.residual_m)
        off.append(part.residual_m[seen] / band[seen])
        inside.append(np.abs(off[-1]) < 2.0)
        learned = replace(found, fit_after=replace(found.fit_after, shots=(replace(part, sway_std_m=None),)))
        assert np.abs(part.residual_m[seen]).max() > 10.0 * np.nanmedian(diagnosis_band(learned, shot)[0])
    assert np.mean(np.concatenate(inside)) > 0.8
    assert 0.4 < np.sqrt(np.mean(np.concatenate(off) ** 2)) < 1.6
