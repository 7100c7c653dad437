"""Search coordinates: combinations of parameters that a record determines separately, so that valleys are straight.

A shot determines the lowest frequency of block, contact and plate to parts in a million, the frequency of the bounces
well, and the other combinations less well.  In k_p, m_p*, k_N, gamma_N these form a curved valley a thousand times
longer than wide.  The search coordinates are log omega_1^2, log m_p*, log(k_N / m_p*), gamma_N / m_p*, and the height
of the flight line at the expected touch instead of the offset.  omega_1^2 is the lowest root of
(k_N - omega^2 m_b)(k_p + k_N - omega^2 m_p) = k_N^2, so k_p follows in closed form.  Each further plate has its own
omega_1 and mass on the same contact.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.collision import Floats, Infeasible


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The map between parameters and search coordinates.

    If ``plate``, the first four base parameters are those of plate and contact; else none is transformed.
    ``further_at`` are the indices of further plates' stiffnesses; each mass follows its stiffness.  ``reference_s``,
    shape (shots,), are the expected touch times.
    """

    block_mass_kg: float
    plate: bool
    reference_s: Floats
    further_at: tuple[int, ...] = ()

    def base_to_search(self, base: Floats) -> Floats:
        """Return the coordinates of base parameters, shape (b,)."""
        z = base.copy()
        if self.plate:
            _, m_p, k_n, gamma_n = (float(value) for value in base[:4])
            z[2:4] = [math.log(k_n / m_p), gamma_n / m_p]
            for at in (0, *self.further_at):
                z[at : at + 2] = self._searched(float(base[at]), float(base[at + 1]), k_n)
        return z

    def own_to_search(self, own: Floats) -> Floats:
        """Return the coordinates of each shot's (v_i, touch time, offset), shape (shots, 3)."""
        velocity, touch_s, offset = own.T
        return np.stack([velocity, touch_s, offset + velocity * (self.reference_s - touch_s)], axis=1)

    def own_parameters(self, z: Floats) -> tuple[Floats, Floats]:
        """Return each shot's parameters at ``z``, shape (shots, 3), and their derivatives, shape (shots, 3, 3)."""
        velocity, touch_s, height = z.T
        ahead_s = self.reference_s - touch_s
        slope = np.tile(np.eye(3), (len(z), 1, 1))
        slope[:, 2, 0], slope[:, 2, 1] = -ahead_s, velocity
        return np.stack([velocity, touch_s, height - velocity * ahead_s], axis=1), slope

    def base_parameters(self, z: Floats) -> tuple[Floats, Floats]:
        """Return the base parameters at ``z``, shape (b,), and their derivatives, (b, b); Infeasible out of range."""
        out = z.copy()
        slope = np.eye(z.size)
        if self.plate:
            if np.any(np.abs(z[[0, 1, 2, *self.further_at, *(at + 1 for at in self.further_at)]]) > 60):
                raise Infeasible("search coordinates beyond any plate")
            m_p = math.exp(z[1])
            k_n = math.exp(z[2]) * m_p
            out[2:4] = [k_n, z[3] * m_p]
            slope[2:4, :4] = [[0.0, k_n, k_n, 0.0], [0.0, z[3] * m_p, 0.0, m_p]]
            for at in (0, *self.further_at):
                out[at], out[at + 1], by_contact = self._plate(
                    float(z[at]), float(z[at + 1]), k_n, slope[at, at : at + 2]
                )
                slope[at + 1, at + 1] = out[at + 1]
                slope[at, 1:3] += by_contact * k_n
        return out, slope

    def _searched(self, k_p: float, m_p: float, k_n: float) -> tuple[float, float]:
        """Return log omega_1^2 and log m_p* of a plate in contact with stiffness k_N."""
        # The smaller root of m_b m_p w^2 - (k_N m_p + (k_p + k_N) m_b) w + k_p k_N = 0, without cancellation.
        m_b = self.block_mass_kg
        middle = k_n * m_p + (k_p + k_n) * m_b
        inner = math.sqrt(middle * middle - 4 * m_b * m_p * k_p * k_n)
        return math.log(2 * k_p * k_n / (middle + inner)), math.log(m_p)

    def _plate(self, log_square: float, log_mass: float, k_n: float, slope: Floats) -> tuple[float, float, float]:
        """Return k_p, m_p* and d k_p / d k_N; write d k_p by both coordinates into ``slope``, shape (2,)."""
        square, m_p, m_b = math.exp(log_square), math.exp(log_mass), self.block_mass_kg
        rest = k_n - square * m_b
        if rest <= 0:
            raise Infeasible("the contact spring alone is softer than the record's slowest swing")
        by_square = k_n * m_b / rest + k_n * square * m_b * m_b / rest**2 + m_p
        slope[:] = square * by_square, square * m_p
        return k_n * square * m_b / rest + square * m_p, m_p, -((square * m_b / rest) ** 2)
