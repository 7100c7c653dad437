"""How strongly a frame sways, told by all of a shot: against a dense covariance, and where the flights cannot know."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.noise.sway_strengths import SeenThrough, Waves, learn
from analysis.pipeline import analyse
from analysis.reading.strengths import powers_of, prior_of
from analysis.shot.disturbance import Shaking
from analysis.shot.doubts import concerning
from analysis.shot.shot import Shot
from instrument.bench.bench import Bench
from instrument.bench.mechanics import Bodies
from instrument.bench.simulate import record_shot
from instrument.bench.site import Knock, site_named

TRUTH = Bodies()
SIGMAS = 4.5
NAMES = ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m")
SPAN_S, SAMPLES, WHITE_M = 0.06, 400, 1e-9
NOTHING = Shaking(np.array([30.0, 31.0, 100.0]), np.array([0.0, 0.0, 25e-18]), np.array([True, True, False]))
WAVES = Waves.of(NOTHING, SPAN_S, 500.0)


def _dense(random: np.random.Generator, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (r, J), shape (n, 3), a floor of these strengths and a straight line, and the waves, in white noises."""
    time_s = np.linspace(0.0, SPAN_S, SAMPLES)
    angle = 2 * np.pi * time_s[:, None] * WAVES.frequency_hz
    waves = np.hstack([np.cos(angle), np.sin(angle)]) / WHITE_M
    power = np.tile(WAVES.power_m2(at), 2)
    rest = waves @ (np.sqrt(power) * random.standard_normal(power.size)) + random.standard_normal(SAMPLES)
    return np.column_stack([rest, np.ones(SAMPLES), time_s]), waves


def _seen(told: np.ndarray, waves: np.ndarray) -> SeenThrough:
    basis = np.linalg.svd(waves, full_matrices=False)[0]
    along = basis.T @ told
    return SeenThrough(basis.T @ waves, along, told.T @ told - along.T @ along)


def test_the_likelihood_is_that_of_the_dense_covariance() -> None:
    random = np.random.default_rng(5)
    at = random.normal(0.0, 1.0, WAVES.octaves.centre_hz.size)
    told, waves = _dense(random, at)
    seen = _seen(told, waves)

    def dense(point: np.ndarray) -> float:
        covariance = (waves * np.tile(WAVES.power_m2(point), 2)) @ waves.T + np.eye(SAMPLES)
        inverse = np.linalg.inv(covariance)
        normal = told.T @ inverse @ told
        assert seen.normal(WAVES.power_m2(point)) == pytest.approx(normal, rel=1e-5, abs=1e-9 * np.abs(normal).max())
        left = normal[0, 0] - normal[0, 1:] @ np.linalg.solve(normal[1:, 1:], normal[1:, 0])
        mean, precision = prior_of(point.size)
        logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal[1:, 1:])[1]
        return float(-0.5 * (logs + left + (point - mean) @ precision @ (point - mean)))

    step = 1e-4 * np.eye(at.size)
    value, slope, _ = seen.likelihood(WAVES, at)
    assert seen.likelihood(WAVES, at + 0.5)[0] - value == pytest.approx(dense(at + 0.5) - dense(at), rel=1e-6)
    numeric = [(dense(at + one) - dense(at - one)) / 2e-4 for one in step]
    assert slope == pytest.approx(numeric, rel=1e-3, abs=1e-3)


def test_strengths_are_found_as_they_were_and_their_spread_holds_them() -> None:
    off = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        true = np.full(WAVES.octaves.centre_hz.size, random.normal(0.0, 2.0))
        seen = _seen(*_dense(random, true))
        best, points = learn(seen, WAVES, np.full(true.size, -3.0))
        again, _ = learn(seen, WAVES, np.full(true.size, 3.0))
        assert again == pytest.approx(best, abs=0.3)
        off.append((best - true) / np.std(points, axis=0))
        assert powers_of(np.mean(points, axis=0)) == pytest.approx(powers_of(best), rel=1e-6)
    told = np.array(off)[:, 1:-1]  # a straight line takes the slowest
    assert np.sqrt(np.mean(told**2)) < 1.5
    assert np.abs(told).max() < SIGMAS


def _knocked(knock: Knock) -> Shot:
    site = replace(site_named("VC-E"), knocks=(knock,))
    return analyse(record_shot(Bench(site=site, seed=6), 0, 0.27, 10e6, 0.06)[0])


@pytest.mark.parametrize("at_s", [0.012, 0.015])
def test_a_knock_during_the_contact_does_not_lead_the_fit_astray(at_s: float) -> None:
    shot = _knocked(Knock(80e-9, 120.0, at_s=at_s))
    assert shot.fit is not None and shot.fit.converged and shot.fit.reduced_chi2 > 2.0
    for name in NAMES:
        found = shot.fit.parameters[name]
        assert abs(found.value - getattr(TRUTH, name)) < SIGMAS * found.std
        assert "knock_suspected" in concerning(name, shot.flags)
    assert "knock_suspected" in concerning("force_peak_n", shot.flags)
