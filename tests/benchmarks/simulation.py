"""Measure the exact solver against Gear's method, and the general integrator against the exact solver.

``python -m tests.benchmarks.simulation``.  Processor time; ratios are of figures taken in turns in one run.
"""

import time
from collections.abc import Callable

import numpy as np

from analysis.collision.effects import CATALOGUE
from analysis.collision.parameters import PAPER
from analysis.collision.solver import gear, general

TIME_S = np.arange(6001) * 1e-5  # 60 ms


def _seconds(*tasks: Callable[[], object], rounds: int = 12) -> list[float]:
    for task in tasks:
        task()
    best = [float("inf")] * len(tasks)
    for _ in range(rounds):
        for place, task in enumerate(tasks):
            began = time.process_time()
            task()
            best[place] = min(best[place], time.process_time() - began)
    return best


def main() -> int:
    """Print speed and agreement; return 1 where a target is missed."""
    missed = 0

    def say(what: str, value: float, limit: float, at_least: bool = False) -> None:
        nonlocal missed
        good = value >= limit if at_least else value <= limit
        missed += not good
        relation = ">=" if at_least else "<="
        print(f"  {what:<66} {value:9.3g}  (target {relation} {limit:g}) {'ok' if good else 'MISSED'}", flush=True)

    slow, fast, tangents = _seconds(
        lambda: gear.simulate(PAPER, 0.06, every=100),
        lambda: general.solve(PAPER, (), TIME_S),
        lambda: general.solve(PAPER, (), TIME_S, directions=range(7)),
    )
    print("60 ms of the paper's collision, 6001 samples:")
    print(f"  Gear at 1e-7 s {slow * 1e3:.2f} ms, exact {fast * 1e3:.3f} ms, with derivatives {tangents * 1e3:.2f} ms")
    say("exact solver: times faster than Gear", slow / fast, 50, at_least=True)
    truth = general.solve(PAPER, (), TIME_S)
    paper = gear.simulate(PAPER, 0.06, every=100)[:, 1]
    own = np.abs(gear.simulate(PAPER, 0.06, step_s=2e-7, every=50)[:, 1] - paper).max()
    apart = np.abs(paper - truth.velocity_m_per_s).max()
    say("exact against Gear over Gear's own change from 2e-7 to 1e-7 s", apart / own, 3)
    run = general.solve(PAPER, [], TIME_S)
    deepest = np.abs(truth.displacement_m).max()
    error = np.abs(run.displacement_m - truth.displacement_m).max() / deepest
    say("general integrator, no effect: relative error of displacement", error, 2e-12)
    for name, effect in CATALOGUE.items():
        if effect.kernel is None:
            continue
        active = [general.ActiveEffect(effect, tuple(p.scale for p in effect.parameters))]
        directions = [0, 1, 2, 3, 4, *(general.direction(0, place) for place in range(len(effect.parameters)))]
        bare, full = _seconds(
            lambda active=active: general.solve(PAPER, active, TIME_S),
            lambda active=active, d=directions: general.solve(PAPER, active, TIME_S, directions=d),
            rounds=6,
        )
        say(f"{name}: ms for 60 ms (with {len(directions)} derivatives {full * 1e3:.1f} ms)", bare * 1e3, 3)
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
