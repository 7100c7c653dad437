"""Shots of a rig with a law off the catalogue, from an integrator of its own (scipy's, events located by it).

Nothing of the model under test is used: block, plate and contact are written out here once more.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from analysis.motion import Motion
from analysis.shot import AnalysisSettings
from analysis.signal.record import motion_from_displacement

BLOCK_KG, PLATE_KG, K_P, K_N, GAMMA_N = 17.85e-3, 1.9e-4, 205.0, 9e3, 0.36
RATE_HZ = 50e3
Force = Callable[[float, float, float, float], float]  # of (x, v, y, u), in N


def nothing(x: float, v: float, y: float, u: float) -> float:
    """Return no force."""
    return 0.0


@dataclass(frozen=True)
class LawRig:
    """A rig with a force ``on_block``, one ``on_plate`` and one ``between`` them while they touch, all in N.

    ``kinks`` are functions of the state at whose zeros a law bends: the integrator stops there.
    """

    on_block: Force = nothing
    on_plate: Force = nothing
    between: Force = nothing  # on the block; the plate feels it reversed
    kinks: tuple[Force, ...] = ()
    noise_m: float = 2e-11
    seed: int = 1

    def displacement_m(self, time_s: np.ndarray, speed_m_per_s: float) -> np.ndarray:
        """Return the block's place at ``time_s``, shape (n,), ascending; it touches the plate at rest at time zero."""
        before = time_s[time_s < 0]
        start = np.array([0.0, -speed_m_per_s, 0.0, 0.0])
        out = np.empty(time_s.size)
        if before.size:
            back = self._solve(start, 0.0, float(before[0]), False, before[::-1])
            out[: before.size] = back[::-1]
        out[before.size :] = self._solve(start, 0.0, float(time_s[-1]), True, time_s[before.size :])
        return out

    def _solve(self, state: np.ndarray, t: float, end: float, touching: bool, times: np.ndarray) -> np.ndarray:
        forwards = end > t
        out = np.empty(times.size)
        done = 0
        while done < times.size:
            moving = forwards

            def rates(_t: float, s: np.ndarray, touching: bool = touching, moving: bool = moving) -> list[float]:
                x, v, y, u = s
                pair = K_N * (y - x) + GAMMA_N * (u - v) + self.between(x, v, y, u) if touching else 0.0
                plate = (-K_P * y - pair + self.on_plate(x, v, y, u)) / PLATE_KG if moving else 0.0
                return [v, (pair + self.on_block(x, v, y, u)) / BLOCK_KG, u if moving else 0.0, plate]

            def gap(_t: float, s: np.ndarray) -> float:
                return float(s[0] - s[2])

            gap.terminal, gap.direction = forwards, (1.0 if touching else -1.0)  # type: ignore[attr-defined]
            bends = []
            for kink in self.kinks:

                def bend(_t: float, s: np.ndarray, kink: Force = kink) -> float:
                    return kink(*s)

                bend.terminal = forwards  # type: ignore[attr-defined]
                bends.append(bend)
            step = 4e-5 if touching else 2e-4
            found = solve_ivp(
                rates, (t, end), state, "DOP853", times[done:], events=[gap, *bends],
                rtol=1e-11, atol=[1e-15, 1e-12, 1e-15, 1e-11], max_step=step,
            )  # fmt: skip
            if len(found.t):
                out[done : done + found.t.size] = found.y[0]
                done += found.t.size
            if found.status != 1:
                break
            fired = [(times_[-1], k) for k, times_ in enumerate(found.t_events) if times_.size]
            t, which = max(fired)
            state = found.y_events[which][-1].copy()
            if which == 0:
                touching = not touching
            step_s = math.copysign(1e-11, end - t)  # past the event, so that it is not met again
            state = state + step_s * np.array(rates(t, state, touching))
            t += step_s
        return out

    def shot(self, speed_m_per_s: float, index: int = 0) -> Motion:
        """Return the motion of one shot, as the demodulator would give it."""
        length = 8e-3 + 1.05 * math.pi * math.sqrt((BLOCK_KG + PLATE_KG) / K_P) + 12e-3
        time_s = np.arange(-400, round((length - 8e-3) * RATE_HZ)) / RATE_HZ
        x = self.displacement_m(time_s, speed_m_per_s)
        noisy = x + self.noise_m * np.random.default_rng((self.seed, index)).standard_normal(x.size)
        motion = motion_from_displacement(
            time_s + 0.02, noisy, None, None, BLOCK_KG, 1e-6, AnalysisSettings().bandwidth_hz
        )
        return replace(motion, wavelength_m=632.8e-9, displacement_std_m=np.full(x.size, self.noise_m))

    def shots(self, speeds: Sequence[float] = (0.15, 0.24, 0.36)) -> list[Motion]:
        """Return shots at several speeds."""
        return [self.shot(speed, index) for index, speed in enumerate(speeds)]
