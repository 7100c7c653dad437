"""Count how often the fit's 95 % intervals hold the truth, and compare its spread with the Cramer-Rao bound.

``python -m tests.benchmarks.fit_coverage [shots]`` (240 without): white noise, white noise on a wandering floor, and
three shots with an effect.  The bound is the covariance at the true parameters with the true noise.
"""

import sys
import time

import numpy as np

from analysis.collision.parameters import PAPER
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.floor import Floor
from analysis.shot.fit import Fit
from analysis.shot.quantity import Quantity
from tests.analysis.collision.simulated import shot

TRUTH = {
    "plate_stiffness_n_per_m": PAPER.plate_stiffness_n_per_m,
    "plate_mass_kg": PAPER.plate_mass_kg,
    "contact_stiffness_n_per_m": PAPER.contact_stiffness_n_per_m,
    "contact_damping_n_s_per_m": PAPER.contact_damping_n_s_per_m,
}


def _report(title: str, fits: list[Fit], truth: dict[str, float], bound: dict[str, float]) -> int:
    missed = 0
    lost = sum(not fit.converged for fit in fits)
    median = np.median([fit.seconds for fit in fits])
    print(f"{title}: {len(fits)} fits, {lost} not converged, {median:.3f} s each (median)")
    covered = 0
    for name, value in truth.items():
        found: list[Quantity] = [fit.parameters[name] for fit in fits if fit.converged]
        values = np.array([q.value for q in found])
        inside = np.mean([abs(q.value - value) < 1.96 * q.std for q in found])
        covered += inside
        stated = np.mean([q.std for q in found]) / values.std(ddof=1)
        line = f"  {name:<40} 95 % interval covers {100 * inside:5.1f} %  mean std/spread {stated:.3f}"
        if name in bound:
            ratio = values.std(ddof=1) / bound[name]
            good = 0.9 <= ratio <= 1.2
            missed += not good
            line += f"  spread/bound {ratio:.3f} (target 0.9 to 1.2) {'ok' if good else 'MISSED'}"
        print(line)
    share = 100 * covered / len(truth)
    good = 92 <= share <= 98
    print(f"  coverage over all parameters {share:.1f} % (target 92 to 98) {'ok' if good else 'MISSED'}", flush=True)
    return missed + (not good) + (lost > 0.01 * len(fits))


def _bound(white_m: float, wander: tuple[float, float] = (0.0, 1e-2)) -> dict[str, float]:
    """Return the Cramer-Rao standard deviations at the truth, for a noise that is known (of one sample of the motion).

    ``wander`` is the rms in m and the memory in s of a part that wanders.
    """
    shots = averaged_shots([shot(seed=1)])
    noise = Floor(white_m / shots[0].factor ** 0.5, (wander[0], 0.0), (wander[1], 1e-2), shots[0].spacing_s)
    problem = Problem(JointData(shots, base_named("paper")), (), noise)
    own = np.array([[PAPER.velocity_in_m_per_s, 0.0123456, 3.1e-3]])
    z = problem.pack(Point(np.array([*TRUTH.values()]), own, ({},)))
    inverse = problem.square(z).curvature.inverse()
    assert inverse is not None
    slope = problem.slopes(z)[0]  # one shot: its places are the vector
    std = np.sqrt(np.diag(slope @ inverse @ slope.T))
    return {name: float(std[place]) for place, name in enumerate(TRUTH)}


def main() -> int:
    """Print coverage and spread; return 1 where a target is missed."""
    shots = int(sys.argv[1]) if len(sys.argv) > 1 else 240
    began = time.perf_counter()
    missed = 0
    fits = [fit_shots([shot(seed=seed)]) for seed in range(shots)]
    missed += _report("white noise 0.15 nm", fits, TRUTH, _bound(1.5e-10))
    fits = [fit_shots([shot(seed=seed, white_m=1e-10, floor_m=4e-10)]) for seed in range(shots)]
    bound = _bound(1e-10, (4e-10, 3e-3))
    missed += _report("white noise 0.1 nm on a floor of 0.4 nm wandering within 3 ms", fits, TRUTH, bound)
    drag = {"quadratic_drag": (1.3e-3,)}
    fits = [
        fit_shots(
            [shot(PAPER.at_speed(v), effects=drag, seed=10 * seed + i) for i, v in enumerate((-0.15, -0.265, -0.4))],
            effects=tuple(drag),
        )
        for seed in range(shots)
    ]
    truth = TRUTH | {"quadratic_drag.coefficient_n_s2_per_m2": 1.3e-3}
    missed += _report("three shots with quadratic drag, white noise", fits, truth, {})
    print(f"{time.perf_counter() - began:.0f} s")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
