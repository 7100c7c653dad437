"""The coordinates the search moves in: what a record determines one by one, so that its valleys run straight.

A shot fixes the lowest frequency of block, contact and plate to parts in a million, the bounces' frequency well, the
rest less; in k_p, m_p*, k_N, gamma_N these mix into a curved valley a thousand times longer than wide.  The search
moves in log omega_1^2, log m_p*, log(k_N / m_p*), gamma_N / m_p*, and in the height of the flight line at the
expected touch instead of the offset.  With omega_1^2 the lowest root of
(k_N - omega^2 m_b)(k_p + k_N - omega^2 m_p) = k_N^2, k_p follows in closed form.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.model.least_squares import Infeasible
from analysis.model.parameters import Floats


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The map between parameters (shared, then own and extra of each shot) and search coordinates.

    ``plate`` says whether the first four parameters are plate and contact (else they are left as they are);
    ``own_at`` holds where each shot's (v_i, touch time, offset) begin, ``reference_s`` its expected touch;
    the parameters ``inverse_at`` are searched by their inverse, those ``logarithmic_at`` by their logarithm.
    """

    block_mass_kg: float
    plate: bool
    own_at: tuple[int, ...]
    reference_s: tuple[float, ...]
    inverse_at: tuple[int, ...] = ()
    logarithmic_at: tuple[int, ...] = ()

    def to_search(self, parameters: Floats) -> Floats:
        """Return the coordinates of ``parameters``, shape (p,)."""
        z = parameters.copy()
        if self.plate:
            k_p, m_p, k_n, gamma_n = (float(value) for value in parameters[:4])
            m_b = self.block_mass_kg
            # Roots of m_b m_p w^2 - (k_N m_p + (k_p + k_N) m_b) w + k_p k_N = 0; the small one without cancellation.
            middle = k_n * m_p + (k_p + k_n) * m_b
            inner = math.sqrt(middle * middle - 4 * m_b * m_p * k_p * k_n)
            z[:4] = [math.log(2 * k_p * k_n / (middle + inner)), math.log(m_p), math.log(k_n / m_p), gamma_n / m_p]
        for at, reference in zip(self.own_at, self.reference_s, strict=True):
            z[at + 2] = parameters[at + 2] + parameters[at] * (reference - parameters[at + 1])
        for at in self.inverse_at:
            z[at] = 1 / parameters[at]
        for at in self.logarithmic_at:
            z[at] = math.log(parameters[at])
        return z

    def to_parameters(self, z: Floats) -> tuple[Floats, Floats]:
        """Return the parameters at ``z`` and their derivatives by ``z``, shape (p, p); Infeasible off the map."""
        out = z.copy()
        slope = np.eye(z.size)
        if self.plate:
            if np.any(np.abs(z[:3]) > 60):
                raise Infeasible("search coordinates beyond any plate")
            square, m_p, ratio, m_b = math.exp(z[0]), math.exp(z[1]), math.exp(z[2]), self.block_mass_kg
            k_n = ratio * m_p
            rest = k_n - square * m_b
            if rest <= 0:
                raise Infeasible("the contact spring alone is softer than the record's slowest swing")
            k_p = k_n * square * m_b / rest + square * m_p
            by_square = k_n * m_b / rest + k_n * square * m_b * m_b / rest**2 + m_p
            by_contact = -((square * m_b / rest) ** 2)
            out[:4] = [k_p, m_p, k_n, z[3] * m_p]
            slope[:4, :4] = [
                [square * by_square, k_n * by_contact + square * m_p, k_n * by_contact, 0.0],
                [0.0, m_p, 0.0, 0.0],
                [0.0, k_n, k_n, 0.0],
                [0.0, z[3] * m_p, 0.0, m_p],
            ]
        for at, reference in zip(self.own_at, self.reference_s, strict=True):
            ahead = reference - z[at + 1]
            out[at + 2] = z[at + 2] - z[at] * ahead
            slope[at + 2, at] = -ahead
            slope[at + 2, at + 1] = z[at]
        for at in self.inverse_at:
            out[at] = 1 / max(z[at], 1e-12)
            slope[at, at] = -(out[at] ** 2)
        for at in self.logarithmic_at:
            out[at] = slope[at, at] = math.exp(min(z[at], 60.0))
        return out, slope
