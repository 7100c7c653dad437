"""``python -m tests.benchmarks.drives``: clean drives of several kinds; how many are given a law that they have not.

A clean drive is mass, drag and a constant force, and nothing else; with ``friction`` dry friction besides, where every
other law is a false one.  Every drive has its own mass of waves, noise and length.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from analysis.diagnosis.driven import diagnose_driven
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisError
from analysis.signal.record import motion_from_displacement
from tests.analysis.drive.slider import RATE_HZ, Drive, Floats

Random = np.random.Generator


def friction(x: Floats, v: Floats) -> Floats:
    return 20.0 * np.sign(v)


def drawn(random: Random) -> Drive:
    """Return a drive on three waves of sizes and frequencies of its own."""
    sizes = np.array([0.08, 0.03, 0.008]) * np.exp(random.normal(0.0, 0.4, 3))
    hertz = np.array([0.31, 0.97, 2.3]) * np.exp(random.normal(0.0, 0.2, 3))
    return Drive(
        waves=tuple((float(size), float(f)) for size, f in zip(sizes, hertz, strict=True)),
        noise_n=float(np.exp(random.uniform(np.log(0.1), np.log(3.0)))),
        encoder_m=float(np.exp(random.uniform(np.log(1e-8), np.log(1e-6)))),
        seconds=float(random.uniform(8.0, 16.0)),
        seed=int(random.integers(1 << 30)),
    )


def _again(motion: Motion, displacement_m: Floats, force_n: Floats) -> Motion:
    return motion_from_displacement(motion.time_s, displacement_m, None, force_n, moving_mass_kg=None)


def plain(random: Random) -> list[Motion]:
    return [drawn(random).motion()]


def cycles(random: Random) -> list[Motion]:
    return [replace(drawn(random), waves=((0.08, 0.25), (0.03, 0.75), (0.008, 1.5)), seconds=16.0).motion()]


def counted(random: Random) -> list[Motion]:
    """Return a drive whose encoder counts steps of 2 um."""
    motion = replace(drawn(random), encoder_m=1e-9).motion()
    return [_again(motion, 2e-6 * np.round(motion.displacement_m / 2e-6), motion.force_n)]


def coloured(random: Random) -> list[Motion]:
    """Return a drive whose force wanders, with a memory of 0.2 s, by as much as its white noise."""
    drive = drawn(random)
    motion = drive.motion()
    fade = float(np.exp(-5.0 / RATE_HZ))
    wander, now = np.empty(motion.force_n.size), 0.0
    for i, step in enumerate(random.normal(0.0, drive.noise_n * np.sqrt(1.0 - fade**2), wander.size)):
        now = fade * now + step
        wander[i] = now
    return [_again(motion, motion.displacement_m, motion.force_n + wander)]


def one_way(random: Random) -> list[Motion]:
    return [replace(drawn(random), steady_m_per_s=0.8).motion()]


def several(random: Random) -> list[Motion]:
    return [drawn(random).motion() for _ in range(3)]


def rubbing(random: Random) -> list[Motion]:
    return [replace(drawn(random), extra=friction).motion()]


KINDS: dict[str, Callable[[Random], list[Motion]]] = {
    kind.__name__: kind for kind in (plain, cycles, counted, coloured, one_way, several, rubbing)
}
TRUE = {"rubbing": {"coulomb_friction"}}


def main(arguments: Sequence[str] | None = None) -> int:
    """Diagnose ``--count`` drives, the kinds in turn, and print how many of each are given a false law."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=84)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    random = np.random.default_rng(options.seed)
    names = list(KINDS)
    tried, false, missed, refused, seconds = Counter[str](), Counter[str](), Counter[str](), Counter[str](), 0.0
    for number in range(options.count):
        kind = names[number % len(names)]
        motions = KINDS[kind](random)
        began = time.perf_counter()
        tried[kind] += 1
        try:
            diagnosis = diagnose_driven(motions)
        except AnalysisError as why:
            refused[kind] += 1
            print(f"  {number}: {kind}: {why}", flush=True)
            continue
        seconds += time.perf_counter() - began
        found, true = {effect.name for effect in diagnosis.effects}, TRUE.get(kind, set())
        false[kind] += bool(found - true)
        missed[kind] += bool(true - found)
        if found != true:
            print(f"  {number}: {kind}: {diagnosis.sentence}", flush=True)
    print("kind          tried  false law  law missed  refused")
    for kind in names:
        print(f"{kind:<12} {tried[kind]:>6} {false[kind]:>10} {missed[kind]:>11} {refused[kind]:>8}")
    total, wrong = sum(tried.values()), sum(false.values())
    print(f"false laws: {wrong} of {total} drives, {wrong / total:.1%}; {seconds / total:.2g} s a diagnosis")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
