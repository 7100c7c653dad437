"""A collision integrated mode by mode by scipy, with effects written out: what the solver is held against."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from analysis.collision.parameters import Collision, Variant

FREE, CONTACT, PARTING, OVERLAPPED = "free", "contact", "parting", "overlapped"


@dataclass(frozen=True)
class Beside:
    """What acts beside the two bodies; ``adhesion``: force and range, ``mode``: mass, rate in rad/s and damping."""

    friction_n: float = 0.0
    adhesion: tuple[float, float] | None = None
    mode: tuple[float, float, float] | None = None
    cubic_n_per_m3: float = 0.0  # of the plate's spring
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)  # moves as A cos(omega t + phi), in whose coordinates all is


@dataclass
class Hybrid:
    """The solution at any times, with every change of mode: its kind, time, and (x, v, y, u)."""

    collision: Collision
    beside: Beside
    events: list[tuple[str, float, np.ndarray]] = field(default_factory=list)

    def solved(self, time_s: np.ndarray) -> np.ndarray:
        """Return the states at ``time_s``, shape (n, 4); of the plate only from the first touch on."""
        c, reach = self.collision, self.beside.adhesion
        edge = reach[1] if reach else 0.0
        begin = edge / c.velocity_in_m_per_s
        y, u = c.plate_displacement_m, c.plate_velocity_m_per_s
        start = np.array([y + edge, c.velocity_in_m_per_s, y, u, y + edge, c.velocity_in_m_per_s])
        out = np.full((time_s.size, 4), np.nan)
        early = time_s <= begin
        if early.any():  # the block alone; what is inside it moves with it
            alone = solve_ivp(
                lambda _, s: [s[1], (self.beside.friction_n) / self._mass], (begin, time_s[0]), start[:2],
                t_eval=time_s[early][::-1], rtol=1e-12, atol=1e-15,
            )  # fmt: skip
            out[early, :2] = alone.y[:, ::-1].T
        phase, near, sign, t = (FREE if reach else CONTACT), reach is not None, -1.0, begin
        if not reach:
            self.events.append(("touch", 0.0, start[:4]))
        state, end = start, time_s[-1]
        while t < end:
            watched = self._watched(phase, near, sign)
            guards = []
            for _, guard, direction in watched:
                guard = self._event(guard, direction)
                guards.append(guard)
            run = solve_ivp(
                lambda at, s, p=phase, n=near, g=sign: self._rates(at, s, p, n, g), (t, end + 1e-6), state,
                method="DOP853", rtol=1e-12, atol=1e-15, events=guards, dense_output=True, max_step=2e-4,
            )  # fmt: skip
            within = (time_s > t) & (time_s <= run.t[-1])
            if within.any():
                out[within] = run.sol(time_s[within])[:4].T
            t, state = float(run.t[-1]), run.y[:, -1]
            if run.status != 1:
                break
            kind = watched[next(k for k, times in enumerate(run.t_events) if times.size)][0]
            self.events.append((kind, t, state[:4]))
            if kind == "turn":
                sign = -sign
            elif kind == "range":
                near = not near
            else:
                phase = self._after(kind, phase)
                near = phase == FREE and reach is not None
        return out

    @property
    def _mass(self) -> float:
        mode = self.beside.mode
        return self.collision.block_mass_kg - (mode[0] if mode else 0.0) * (len(self.events) > 0)

    @staticmethod
    def _event(guard: Any, direction: float) -> Any:
        def event(_t: float, state: np.ndarray) -> float:
            return float(guard(state))

        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
        return event

    def _law(self, s: np.ndarray, dash: bool) -> float:
        c = self.collision
        damping = c.contact_damping_n_s_per_m * (s[3] - s[1]) if dash else 0.0
        return float(c.contact_stiffness_n_per_m * (s[2] - s[0]) + damping)

    def _rates(self, t: float, s: np.ndarray, phase: str, near: bool, sign: float) -> list[float]:
        c, beside = self.collision, self.beside
        size, rate, turn = beside.frame
        felt = size * rate**2 * np.cos(rate * t + turn)  # minus the frame's acceleration
        x, v, y, u, q, w = s
        force = self._law(s, phase == CONTACT) if phase in (CONTACT, PARTING) else 0.0
        if beside.adhesion and near:
            force -= beside.adhesion[0]
        pull, mass = 0.0, c.block_mass_kg
        if beside.mode:
            m, omega, damping = beside.mode
            pull = omega**2 * (q - x) + 2 * damping * omega * (w - v)
            mass -= m
        on_block = force - beside.friction_n * sign + (beside.mode[0] * pull if beside.mode else 0.0)
        plate = -force - c.plate_stiffness_n_per_m * y - beside.cubic_n_per_m3 * y**3
        return [v, on_block / mass + felt, u, plate / c.plate_mass_kg + felt, w, -pull]

    def _watched(self, phase: str, near: bool, sign: float) -> list[tuple[str, Any, float]]:
        variant, reach = self.collision.variant, self.beside.adhesion
        out: list[tuple[str, Any, float]] = []
        if phase == FREE:
            out.append(("touch", lambda s: s[2] - s[0], 1.0))
        elif not (variant is Variant.NO_TENSION and phase == CONTACT):
            out.append(("apart" if phase == OVERLAPPED else "release", lambda s: s[2] - s[0], -1.0))
        if variant is Variant.CLAMPED and phase == CONTACT:
            out.append(("damping_off", lambda s: s[3] - s[1], -1.0))
        if phase == PARTING:
            out.append(("damping_on", lambda s: s[3] - s[1], 1.0))
        if variant is Variant.NO_TENSION and phase == CONTACT:
            out.append(("release", lambda s: self._law(s, True), -1.0))
        if phase == OVERLAPPED:
            out.append(("touch", lambda s: self._law(s, True), 1.0))
        out.append(("turn", lambda s: s[1], -sign))
        if reach and phase == FREE:
            out.append(("range", lambda s: s[0] - s[2] - reach[1], 1.0 if near else -1.0))
        return out

    def _after(self, kind: str, phase: str) -> str:
        released = OVERLAPPED if self.collision.variant is Variant.NO_TENSION and phase == CONTACT else FREE
        after = {"touch": CONTACT, "release": released, "apart": FREE, "damping_off": PARTING, "damping_on": CONTACT}
        return after[kind]


def moved(collision: Collision, beside: Beside, name: str, by: float) -> tuple[Collision, Beside]:
    """Return both with one number changed: a field of either, or of a tuple as "mode.1"."""
    plain, _, place = name.partition(".")
    one: Any = collision if hasattr(collision, plain) else beside
    value = getattr(one, plain)
    changed = tuple(v + by * (k == int(place)) for k, v in enumerate(value)) if place else value + by
    one = replace(one, **{plain: changed})
    return (one, beside) if hasattr(collision, plain) else (collision, one)
