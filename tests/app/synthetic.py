"""Shots for panel tests, integrated from the two bodies in the plainest way; none of it pretends to be measured."""

from functools import lru_cache

import numpy as np

from analysis.collision.effects import effect_named
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.findings.result import (
    BlindSpot,
    Candidate,
    Diagnosis,
    DriveEvidence,
    DriveRemainder,
    Errors,
    FoundEffect,
    LearnedLaw,
    OtherForm,
    Verdict,
)
from analysis.drive import LAWS, MassCheck, Repeatability
from analysis.drive.driven_fit import fit_driven
from analysis.shot.fit import Fit, Overlay, ShotFit
from analysis.shot.impact import Impact, KineticCor
from analysis.shot.motion import BeatQuality, Motion
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Setup
from analysis.shot.shot import AnalysisSettings, Shot
from tests.analysis.drive.slider import Drive

RATE_HZ = 100e3
TOUCH_S = 0.060
DRIVE = DriveEvidence(
    Repeatability(0.1, True, 4.0),
    MassCheck(None, Quantity(0.2, 1e-3), agrees=True),
    50.0,
    (LAWS["drive_delay"],),
    DriveRemainder(0.1, 0.2, 0.3, 0.4),
)


@lru_cache(maxsize=16)
def trajectory(speed: float, count: int) -> dict[str, np.ndarray]:
    """Return x_b, v_b, force, y, gap on the grid; semi-implicit Euler at 1 us."""
    m_b, m_p, k_p, k_n, g_n = 17.85e-3, 1.984e-4, 221.4, 1e4, 0.4
    h = 1e-6
    x, v, y, w = speed * TOUCH_S, -speed, 0.0, 0.0
    stride = round(1 / RATE_HZ / h)
    out = np.empty((5, count))
    for i in range(count):
        for _ in range(stride):
            xi = y - x
            f = k_n * xi + g_n * (w - v) if xi > 0 else 0.0
            v += h * f / m_b
            w += h * (-k_p * y - f) / m_p
            x += h * v
            y += h * w
        out[:, i] = x, v, f, y, x - y
    return dict(zip(("x", "v", "f", "y", "gap"), out, strict=True))


def bare_shot(name: str) -> Shot:
    """Return a shot of which nothing is known."""
    return Shot(name, None, AnalysisSettings(), None, None, None, None, None, None, None)


def shot(
    name: str = "shot-1", speed: float = 0.265, seed: int = 1, count: int = 14000, problem: str | None = None
) -> Shot:
    """Return a whole analysed shot."""
    random = np.random.default_rng(seed)
    course = trajectory(speed, count)
    time_s = np.arange(count) / RATE_HZ
    x_noise, v_noise, f_noise = 1e-9, 8e-6, 2e-3

    def noisy(values: np.ndarray, std: float) -> np.ndarray:
        return values + std * random.standard_normal(count)

    def flat(std: float) -> np.ndarray:
        return np.full(count, std)

    displacement = noisy(course["x"], x_noise)
    motion = Motion(
        time_s=time_s,
        displacement_m=displacement,
        velocity_m_per_s=noisy(course["v"], v_noise),
        acceleration_m_per_s2=noisy(course["f"], f_noise) / 17.85e-3,
        force_n=noisy(course["f"], f_noise),
        displacement_std_m=flat(x_noise),
        velocity_std_m_per_s=flat(v_noise),
        acceleration_std_m_per_s2=flat(f_noise / 17.85e-3),
        force_std_n=flat(f_noise),
        valid=np.ones(count, bool),
        sample_rate_hz=RATE_HZ,
        bandwidth_hz=10e3,
        displacement_band_hz=40e3,
        moving_mass_kg=17.85e-3,
        moving_mass_u_kg=1e-6,
        wavelength_m=632.82e-9,
        rest_frequency_hz=Quantity(2.73e6, 0.3, "mean of PD0"),
        trigger_time_s=0.02,
        reference=BeatQuality(2.73e6, 0.4, 41.0, 0.0),
        measurement=BeatQuality(2.73e6, 0.4, 38.0, 0.0),
    )
    overlay = Overlay(time_s, course["x"], course["v"], course["f"], course["gap"])
    v_in, v_out = -speed, 0.987556 * speed
    impact = Impact(
        touch_time_s=Quantity(TOUCH_S, 1e-6, "crossing of the flight's line"),
        release_time_s=Quantity(TOUCH_S + 28.7077e-3, 2e-6, "force back at zero"),
        turnaround_time_s=Quantity(TOUCH_S + 14.33e-3, 2e-6, "zero of velocity"),
        velocity_in_m_per_s=Quantity(v_in, 1.3e-6, "line through 40 ms of flight, samples 1900 to 5900"),
        velocity_out_m_per_s=Quantity(v_out, 1.4e-6, "line through 40 ms of flight after release"),
        cor_quasi_static=Quantity(0.987556, 7e-6, "speeds of both flights"),
        cor_impulse=Quantity(0.98751, 4e-5, "impulse of force, split at v = 0"),
        cor_kinetic=KineticCor(
            Quantity(0.563, 0.006, "three force peaks"), Quantity(0.500, 0.009, "three onsets"),
            NotSeen("the second flight is shorter than the filter's 0.1 ms"), Quantity(0.61, 0.01, "fitted contact"),
        ),
        force_peak_n=Quantity(0.5119, 0.0012, "parabola over the smoothed peak"),
        force_fwhm_s=Quantity(19.1e-3, 4e-5, "half maximum of the 300 Hz pulse"),
        contact_time_s=Quantity(28.71e-3, 3e-5, "touch to release"),
        deflection_max_m=Quantity(2.3885e-3, 2e-9, "depth below first touch"),
        stiffness_slope_n_per_m=Quantity(214.3, 0.3, "line through 6 to 28 ms"),
        bounce_onsets_s=(TOUCH_S, TOUCH_S + 1.566e-3, TOUCH_S + 2.349e-3),
        bounce_peaks_s=(TOUCH_S + 0.1622e-3, TOUCH_S + 1.7708e-3, TOUCH_S + 2.6767e-3),
    )  # fmt: skip
    residual = displacement - course["x"]
    fit = Fit(
        model="paper",
        parameters={
            "plate_stiffness_n_per_m": Quantity(221.4 + 0.02 * seed, 0.03, "joint fit in displacement"),
            "plate_mass_kg": Quantity(1.984e-4, 4e-7, "joint fit in displacement"),
            "contact_stiffness_n_per_m": Quantity(1e4, 60.0, "joint fit in displacement"),
            "contact_damping_n_s_per_m": Quantity(0.4, 0.003, "joint fit in displacement"),
        },
        covariance=np.eye(4),
        shots=(
            ShotFit(
                Quantity(v_in, 1e-6), Quantity(v_out, 1e-6), Quantity(TOUCH_S, 1e-7), Quantity(0.0, 1e-9),
                overlay, residual, 1.02,
            ),
        ),
        reduced_chi2=1.02,
        noise_std_m=x_noise,
        converged=True,
    )  # fmt: skip
    failed = problem is not None
    return Shot(
        name=name,
        path=None,
        settings=AnalysisSettings(),
        setup=Setup(17.85e-3),
        sample_rate_hz=30e6,
        samples=5_000_000,
        trigger_time_s=0.02,
        motion=None if failed else motion,
        impact=None if failed else impact,
        fit=None if failed else fit,
        flags=("clipped",) if seed == 2 else (),
        problem=problem,
        started_at=f"2026-03-01T10:1{seed}:05Z",
    )


def driven_shot(name: str = "driven") -> Shot:
    """Return a driven record with the fit of mass, drag and offset."""
    motion = Drive().motion()
    settings = AnalysisSettings(model="driven")
    return Shot(name, None, settings, None, None, None, None, motion, None, fit_driven([motion]))


def diagnosis(of: Shot) -> Diagnosis:
    """Return a diagnosis that found quadratic drag."""
    assert of.fit is not None
    before = Errors(62e-9, 40e-6, 3.1e-3, 3800.0)
    after = Errors(1.1e-9, 8e-6, 2.0e-3, 1.01)
    names = ("quadratic_drag", "viscous_drag", "coulomb_friction", "tilt", "adhesion", "frame_vibration")
    return Diagnosis(
        verdict=Verdict.EFFECT_FOUND,
        effects=(
            FoundEffect(
                effect_named("quadratic_drag"),
                {"coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)},
                {"delta_bic": 812.0},
                (effect_named("viscous_drag"),),
            ),
        ),
        candidates=tuple(
            Candidate(effect_named(n), 60.0 / (i + 1), -812.0 / (i + 1) ** 2) for i, n in enumerate(names)
        ),
        error_before=before,
        error_after=after,
        error_held_out_before=Errors(70e-9, 41e-6, 3.2e-3, 4000.0),
        error_held_out_after=Errors(1.3e-9, 8e-6, 2.0e-3, 1.05),
        fit_before=of.fit,
        fit_after=of.fit,
        blind_spots=(BlindSpot(effect_named("tilt"), "angle_rad", 2e-5),),
        speeds_m_per_s=(0.2,),
        drive=None if of.fit.shots else DRIVE,
    )


def learned_law() -> LearnedLaw:
    """Return a law of the place with another form that fits, and one of the bend."""
    at = np.linspace(-2e-3, 1e-3, 31)
    force = -4e-3 * np.exp(-np.abs(at) / 5e-4)
    own = law_from_table(
        {
            "name": "law_exponential", "words": "a force as a function of place, exponential", "where": "block",
            "formula": "a*exp(-abs(x)/b)",
            "parameters": {"a": {"unit": "N", "start": -4e-3}, "b": {"unit": "m", "start": 5e-4, "lower": 1e-6}},
        }
    )  # fmt: skip
    other = OtherForm("block", "place", "inverse square", "a/(1 + abs(x)/b)**2", 4.2, 0.9 * force)
    far = OtherForm("plate", "bend", "hinge", "a*max(0, y - c)", 8.0)
    return LearnedLaw(
        own, "block", "place", "exponential", own.formula.text, "exponential",
        {"a": (Quantity(-4e-3, 1e-6), "N"), "b": (Quantity(5e-4, 1e-7), "m")}, (other, far), (), at, "m", force,
        np.full(31, 1e-5), (-2e-3, 1e-3), ("any part outside the range covered",), {"delta_bic": -900.0}, force,
    )  # fmt: skip
