"""Shots of a rig with a law off the catalogue, from an integrator of its own (scipy's, events located by it).

Nothing of the model under test is used: block, plate and contact are written out here once more.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field, fields, replace

import numpy as np
from scipy.integrate import solve_ivp

from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisSettings
from analysis.signal.record import motion_from_displacement

RATE_HZ = 50e3
Force = Callable[[float, float, float, float], float]  # of (x, v, y, u), in N


def nothing(x: float, v: float, y: float, u: float) -> float:
    """Return no force."""
    return 0.0


@dataclass(frozen=True, slots=True)
class Bodies:
    """The rig without its law."""

    block_kg: float = 17.85e-3
    plate_kg: float = 1.9e-4
    k_p: float = 205.0
    k_n: float = 9e3
    gamma_n: float = 0.36


@dataclass(frozen=True, slots=True)
class Memory:
    """A force with a state z of its own: ``rate`` is its derivative, the forces are functions of (x, v, y, u, z)."""

    rate: Callable[[float, float, float, float, float], float]
    on_block: Callable[[float, float, float, float, float], float] = lambda *_: 0.0
    on_plate: Callable[[float, float, float, float, float], float] = lambda *_: 0.0


@dataclass(frozen=True)
class LawRig:
    """A rig with a force ``on_block``, one ``on_plate`` and one ``between`` them while they touch, all in N.

    ``kinks`` are functions of the state at whose zeros a law bends: the integrator stops there.
    """

    on_block: Force = nothing
    on_plate: Force = nothing
    between: Force = nothing  # on the block; the plate feels it reversed
    kinks: tuple[Force, ...] = ()
    memory: Memory | None = None
    noise_m: float = 2e-11
    seed: int = 1
    bodies: Bodies = field(default_factory=Bodies)

    def displacement_m(self, time_s: np.ndarray, speed_m_per_s: float, step_s: float = 4e-5) -> np.ndarray:
        """Return the block's place at ``time_s``, shape (n,), ascending; it touches the plate at rest at time zero.

        ``step_s`` is the longest step while they touch.
        """
        before = time_s[time_s < 0]
        start = np.array([0.0, -speed_m_per_s, 0.0, 0.0, 0.0])
        out = np.empty(time_s.size)
        if before.size:
            back = self._solve(start, 0.0, float(before[0]), False, before[::-1], step_s)
            out[: before.size] = back[::-1]
        out[before.size :] = self._solve(start, 0.0, float(time_s[-1]), True, time_s[before.size :], step_s)
        return out

    def norms(self, speeds: Sequence[float], beside: Sequence["LawRig"] = ()) -> float:
        """Return what the law leaves beside the bodies' own parameters and the starts, over the noise of a sample.

        To first order: what one rig without the law can imitate is moved out of the difference that the law makes,
        and so is what rigs of other laws ``beside`` do, each of any size.
        """
        bare = LawRig(bodies=self.bodies)
        time_s, step_s = np.arange(-8e-3, self._end_s, 4 / RATE_HZ), 3e-4
        names = [one.name for one in fields(Bodies)]
        first = len(names) + 3 * len(speeds)
        columns = np.zeros((len(speeds), time_s.size, first + len(beside)))
        left = np.zeros((len(speeds), time_s.size))
        for index, speed in enumerate(speeds):
            x = bare.displacement_m(time_s, speed, step_s)
            left[index] = self.displacement_m(time_s, speed, step_s) - x
            for k, name in enumerate(names):
                other = replace(self.bodies, **{name: getattr(self.bodies, name) * 1.001})
                columns[index, :, k] = LawRig(bodies=other).displacement_m(time_s, speed, step_s) - x
            columns[index, :, 5 + 3 * index] = bare.displacement_m(time_s, speed * 1.001, step_s) - x
            columns[index, :, 6 + 3 * index] = np.gradient(x, time_s)
            columns[index, :, 7 + 3 * index] = 1.0  # where zero lies is a shot's own
            for k, other_law in enumerate(beside):
                columns[index, :, first + k] = other_law.displacement_m(time_s, speed, step_s) - x
        flat = columns.reshape(-1, columns.shape[2])
        flat = flat / np.linalg.norm(flat, axis=0)
        basis, _ = np.linalg.qr(np.delete(flat, 0, axis=1))  # of the masses only their ratio to the springs tells
        rest = left.ravel() - basis @ (basis.T @ left.ravel())
        return float(np.linalg.norm(rest) * 2.0 / self.noise_m)

    @property
    def _end_s(self) -> float:
        moving_kg = self.bodies.block_kg + self.bodies.plate_kg
        return 1.05 * math.pi * math.sqrt(moving_kg / self.bodies.k_p) + 12e-3

    def _solve(
        self, state: np.ndarray, t: float, end: float, touching: bool, times: np.ndarray, step_s: float
    ) -> np.ndarray:
        forwards = end > t
        out = np.empty(times.size)
        done = 0
        block_kg, plate_kg, k_p, k_n, gamma_n = astuple(self.bodies)
        memory = self.memory
        while done < times.size:
            moving = forwards

            def rates(_t: float, s: np.ndarray, touching: bool = touching, moving: bool = moving) -> list[float]:
                x, v, y, u, z = s
                pair = k_n * (y - x) + gamma_n * (u - v) + self.between(x, v, y, u) if touching else 0.0
                plate = (-k_p * y - pair + self.on_plate(x, v, y, u)) / plate_kg if moving else 0.0
                block = (pair + self.on_block(x, v, y, u)) / block_kg
                drift = 0.0
                if memory is not None and moving:
                    block += memory.on_block(x, v, y, u, z) / block_kg
                    plate += memory.on_plate(x, v, y, u, z) / plate_kg
                    drift = memory.rate(x, v, y, u, z)
                return [v, block, u if moving else 0.0, plate, drift]

            def gap(_t: float, s: np.ndarray) -> float:
                return float(s[0] - s[2])

            gap.terminal, gap.direction = forwards, (1.0 if touching else -1.0)  # type: ignore[attr-defined]
            bends = []
            for kink in self.kinks if forwards else ():

                def bend(_t: float, s: np.ndarray, kink: Force = kink) -> float:
                    return kink(*s[:4])

                bend.terminal = forwards  # type: ignore[attr-defined]
                bends.append(bend)
            step = step_s if touching else 5 * step_s
            found = solve_ivp(
                rates, (t, end), state, "DOP853", (np.maximum if forwards else np.minimum)(times[done:], t),
                events=[gap, *bends],
                rtol=1e-11, atol=[1e-15, 1e-12, 1e-15, 1e-11, 1e-15], max_step=step,
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
            past_s = math.copysign(1e-11, end - t)  # so that the event is not met again
            state = state + past_s * np.array(rates(t, state, touching))
            t += past_s
        return out

    def shot(self, speed_m_per_s: float, index: int = 0) -> Motion:
        """Return the motion of one shot, as the demodulator would give it."""
        time_s = np.arange(-400, round(self._end_s * RATE_HZ)) / RATE_HZ
        x = self.displacement_m(time_s, speed_m_per_s)
        noisy = x + self.noise_m * np.random.default_rng((self.seed, index)).standard_normal(x.size)
        motion = motion_from_displacement(
            time_s + 0.02, noisy, None, None, self.bodies.block_kg, 1e-6, AnalysisSettings().bandwidth_hz
        )
        return replace(motion, wavelength_m=632.8e-9, displacement_std_m=np.full(x.size, self.noise_m))

    def shots(self, speeds: Sequence[float] = (0.15, 0.24, 0.36)) -> list[Motion]:
        """Return shots at several speeds."""
        return [self.shot(speed, index) for index, speed in enumerate(speeds)]
