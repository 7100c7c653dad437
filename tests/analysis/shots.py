"""Analysed shots without a motion, for tests of what comes after the analysis."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from analysis.shot.fit import Fit
from analysis.shot.impact import Impact, KineticCor
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Setup
from analysis.shot.shot import AnalysisSettings, Shot
from tests.analysis.impacts import impact_of


def fit_of(**values: tuple[float, float]) -> Fit:
    """Return a converged fit with these parameters, each (value, std), uncorrelated."""
    parameters = {name: Quantity(*pair) for name, pair in values.items()}
    return Fit("paper", parameters, np.diag([q.std**2 for q in parameters.values()]), (), 1.0, 1e-10, True)


PAPER_FIT = fit_of(
    plate_stiffness_n_per_m=(221.4, 0.002),
    plate_mass_kg=(1.984e-4, 1e-8),
    contact_stiffness_n_per_m=(1e4, 2.0),
    contact_damping_n_s_per_m=(0.4, 1e-4),
)
ONSETS = (0.02, 0.02 + 1.56573968e-3, 0.02 + 2.34904083e-3)
PEAKS = (0.02 + 0.16220e-3, 0.02 + 1.77080e-3, 0.02 + 2.67670e-3)
RELEASES = (0.02 + 0.45318387e-3, 0.02 + 2.16218652e-3)


def paper_impact(**changes: Any) -> Impact:
    """Return the reference solution's readings with the instants of its bounces."""
    kinetic = KineticCor(Quantity(0.5632, 1e-3), Quantity(0.5003, 1e-3), Quantity(0.168, 2e-3), Quantity(0.5839, 1e-4))
    instants = {"bounce_onsets_s": ONSETS, "bounce_peaks_s": PEAKS, "bounce_releases_s": RELEASES}
    return impact_of(**({"cor_kinetic": kinetic} | instants | changes))


def shot_of(name: str = "shot-1", **changes: Any) -> Shot:
    """Return an analysed shot of the paper's rig."""
    parts: dict[str, Any] = {
        "path": None,
        "settings": AnalysisSettings(),
        "setup": Setup(moving_mass_kg=17.85e-3, moving_mass_u_kg=1e-6, wavelength_air_m=632.8e-9),
        "sample_rate_hz": 30e6,
        "samples": 5_000_000,
        "trigger_time_s": None,
        "motion": None,
        "impact": paper_impact(),
        "fit": PAPER_FIT,
    }
    return Shot(name, **(parts | changes))


def at_speed(name: str, speed: float, cor: float, cor_std: float) -> Shot:
    """Return a shot at another speed, everything proportional to it scaled."""
    into, out = Quantity(-speed, 1e-8), Quantity(speed * cor, speed * cor_std)
    force = Quantity(0.511915 * speed / 0.265, 1e-5)
    impact = paper_impact(
        velocity_in_m_per_s=into,
        velocity_out_m_per_s=out,
        cor_quasi_static=Quantity(cor, math.hypot(cor_std, cor * 1e-8 / speed)),
        force_peak_n=force,
    )
    return shot_of(name, impact=impact)


def shots_of(motions: Iterable[Motion]) -> list[Shot]:
    """Return shots of these motions, named "1", "2" ..., with neither readings nor fit."""
    return [shot_of(str(n), motion=motion, impact=None, fit=None) for n, motion in enumerate(motions, 1)]
