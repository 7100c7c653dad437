"""The simulated rig for planned shots: two present shots, and planned ones as they are taken."""

from collections.abc import Sequence
from dataclasses import replace

from analysis.planning.next_shot import NextShot
from instrument.bench.effects import Effects
from tests.analysis.diagnosis.shots import WHITE_M
from tests.bench.blind import Take, Truth, drawn
from tests.bench.displacement_noise import Noise, NoiseKind


def rig(effects: Effects) -> Truth:
    """Return a rig with ``effects`` and two shots."""
    truth = drawn((), 7, Noise(NoiseKind.WHITE, white_m=WHITE_M))
    return replace(truth, effects=effects, speeds_m_per_s=(0.22, 0.3))


def with_shots(truth: Truth, shots: Sequence[NextShot], contact_s: float) -> Truth:
    """Return the rig with planned shots taken, the contacts lasting ``contact_s``."""
    usual = [Take()] * len(truth.speeds_m_per_s)
    takes = [Take(s.added_mass_kg, s.before_s, s.before_s + contact_s + s.after_s) for s in shots]
    speeds = (*truth.speeds_m_per_s, *(shot.speed_m_per_s for shot in shots))
    return replace(truth, speeds_m_per_s=speeds, takes=(*usual, *takes))
