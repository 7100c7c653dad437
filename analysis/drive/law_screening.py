"""Estimate by how much each law, and each pair of laws, would reduce the residual, before any fit.

Pairs are screened as well as single laws, because two laws may be visible only together: without friction near rest, a
delay alone makes a drive's fit worse.  A law's columns at every point of its grid are made orthogonal to the fitted
model and projected onto the residual.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.drive.catalogue import LAWS, Law
from analysis.drive.regression import DEPENDENT, Regression, Values, delay_of, regress
from analysis.drive.stretch import Mask, Stretch, Table, low_pass
from analysis.inference import orthonormal
from analysis.shot import Floats

MAX_WAVES = 400.0  # waves along the travel of the finest ripple that is searched
WAVE_STEP = 0.4
RIPPLES = 3
APART_FROM_FORCE = 0.1  # least share orthogonal to the force, of a law computed from it; otherwise circular


@dataclass(frozen=True, slots=True)
class CandidateLaws:
    """Laws to add, starting values of their nonlinear parameters, and the sum of squares that they would remove."""

    laws: tuple[str, ...]
    nonlinear: Values
    gain_n2: float

    def joined(self, other: "CandidateLaws", gain_n2: float) -> "CandidateLaws":
        """Return both, which together would remove ``gain_n2``."""
        return CandidateLaws((*self.laws, *other.laws), {**self.nonlinear, **other.nonlinear}, gain_n2)

    def added_to(self, found: Regression, table: Table) -> Regression:
        """Return a fit repeated with these laws, over the same samples.  Raises AnalysisError, Cancelled."""
        return regress(table, (*found.laws, *self.laws), found.mask, {**found.nonlinear, **self.nonlinear})


@dataclass(frozen=True, slots=True)
class ScreenedLaws:
    """Candidates, best first, and the laws that depend linearly on the model in this motion, whatever their values."""

    singles: tuple[CandidateLaws, ...]
    pairs: tuple[CandidateLaws, ...]
    unidentifiable: tuple[str, ...]


def screen_laws(
    table: Table, found: Regression, *, pairs: bool = True, laws: Sequence[str] = tuple(LAWS)
) -> ScreenedLaws:
    """Screen those of ``laws`` that are not in the fit ``found``, over the samples of that fit."""
    mask = found.mask
    basis = orthonormal(found.tangents[mask])
    rest = project_out(basis, found.residual_n[mask])
    missing = [LAWS[name] for name in laws if name not in found.laws]
    singles: list[CandidateLaws] = []
    columns: list[Floats] = []  # of each of the singles: orthonormal, and orthogonal to the model
    unidentifiable = []
    for law in (law for law in missing if law.force is not None):
        ripple = law.name == "position_ripple"
        places = _ripple_pitches(table, mask, basis, rest) if ripple else grid_points(law, table.stretches)
        seen = [(at, new) for at in places if (new := _new_columns(table, law, at, mask, basis)) is not None]
        singles += [CandidateLaws((law.name,), _named(law, at), _square(new.T @ rest)) for at, new in seen]
        columns += [new for _, new in seen]
        if places and not seen:
            unidentifiable.append(law.name)
    delay = LAWS["drive_delay"]
    later = _delayed(table, found, basis) if delay in missing else {}
    size = _square(rest)
    delays = [CandidateLaws((delay.name,), _named(delay, (at,)), size - _square(r)) for at, r in later.items()]
    both = list(_pairs(singles, columns, rest)) if pairs else []
    if pairs:
        both += [
            single.joined(delayed, delayed.gain_n2 + _square(new.T @ left))
            for delayed, left in zip(delays, later.values(), strict=True)
            for single, new in zip(singles, columns, strict=True)
        ]
    return ScreenedLaws(_best([*singles, *delays]), _best(both), tuple(unidentifiable))


def grid_points(law: Law, stretches: Sequence[Stretch]) -> list[tuple[float, ...]]:
    """Return the points of a law's grid, in the parameters' units."""
    axes = [[share * p.scale_in(stretches) for share in p.grid] for p in law.nonlinear_parameters]
    return list(itertools.product(*axes))


def project_out(basis: Floats, columns: Floats) -> Floats:
    """Return columns, shape (m,) or (m, k), minus their projection onto an orthonormal basis (m, j)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def _new_columns(table: Table, law: Law, at: tuple[float, ...], mask: Mask, basis: Floats) -> Floats | None:
    """Return an orthonormal basis of a law's columns after projection off the model; None if they depend on it."""
    columns = table.columns(law, at)[mask]
    size = np.linalg.norm(columns, axis=0)
    if not (size > 0.0).all():
        return None
    alone = project_out(basis, columns / size)
    left, strength, _ = np.linalg.svd(alone, full_matrices=False)
    seen = strength > DEPENDENT
    if law.of_force:
        force = orthonormal(project_out(basis, table.force()[mask][:, None]))
        seen &= np.linalg.norm(project_out(force, alone)) > APART_FROM_FORCE
    return np.asarray(left) if seen.all() else None


def _delayed(table: Table, found: Regression, basis: Floats) -> dict[float, Floats]:
    """Return the residuals for a delayed or advanced force, as a mapping from the delay in s."""
    law = LAWS["drive_delay"]
    now = table.force(delay_of(found.nonlinear))[found.mask]
    rest = found.residual_n[found.mask]
    out = {}
    for (at,) in grid_points(law, table.stretches):
        if at != 0.0:
            out[at] = project_out(basis, rest + table.force(at)[found.mask] - now)
    return out


def _ripple_pitches(table: Table, mask: Mask, basis: Floats, rest: Floats) -> list[tuple[float, ...]]:
    """Return the pitches at which the residual has the strongest waves along the travel."""
    place, speed = table.displacement_m[mask], np.abs(table.velocity_m_per_s[mask])
    travel = float(np.ptp(place))
    rate, bandwidth = table.stretches[0].sample_rate_hz, table.stretches[0].bandwidth_hz
    taps = low_pass(rate, bandwidth)
    frequencies = np.linspace(0.0, 3.0 * bandwidth, 61)
    lag = np.arange(taps.size) - taps.size // 2
    gain = np.cos(2.0 * np.pi * frequencies[:, None] / rate * lag) @ taps
    slow = float(np.quantile(speed, 0.2))
    finest = min(MAX_WAVES, 1.5 * bandwidth * travel / slow)  # the filter removes finer waves
    found = []
    for wave in np.arange(1.5, finest, WAVE_STEP).tolist():
        through = np.interp(speed * wave / travel, frequencies, gain, right=0.0)
        angle = 2.0 * np.pi * wave / travel * place
        columns = project_out(basis, np.stack([np.sin(angle) * through, np.cos(angle) * through], axis=1))
        pull = columns.T @ rest
        found.append((float(pull @ np.linalg.pinv(columns.T @ columns, rcond=1e-6) @ pull), wave))
    chosen: list[float] = []
    for _, wave in sorted(found, reverse=True):
        if all(abs(wave - other) > 1.0 for other in chosen):
            chosen.append(wave)
        if len(chosen) == RIPPLES:
            break
    return [(travel / wave,) for wave in chosen]


def _pairs(singles: Sequence[CandidateLaws], columns: Sequence[Floats], rest: Floats) -> Iterator[CandidateLaws]:
    """Yield the pairs of two laws at every point of their grids, unless they are nearly one."""
    if not singles:
        return
    every = np.concatenate(columns, axis=1)
    ends = np.cumsum([0, *(new.shape[1] for new in columns)])
    gram, pull = every.T @ every, every.T @ rest
    for i, j in itertools.combinations(range(len(singles)), 2):
        if singles[i].laws == singles[j].laws:
            continue
        a, b = slice(ends[i], ends[i + 1]), slice(ends[j], ends[j + 1])
        cross = gram[a, b]
        inner = np.eye(cross.shape[1]) - cross.T @ cross  # of b after orthogonalisation to a
        if np.linalg.eigvalsh(inner)[0] < 1e-4:
            continue
        new = pull[b] - cross.T @ pull[a]
        yield singles[i].joined(singles[j], singles[i].gain_n2 + float(new @ np.linalg.solve(inner, new)))


def _named(law: Law, values: Sequence[float]) -> dict[str, float]:
    return dict(zip(law.nonlinear_names, values, strict=True))


def _square(vector: Floats) -> float:
    return float(vector @ vector)


def _best(candidates: Sequence[CandidateLaws]) -> tuple[CandidateLaws, ...]:
    """Return the best candidate of every set of laws, best first."""
    kept: dict[tuple[str, ...], CandidateLaws] = {}
    for candidate in sorted(candidates, key=lambda g: -g.gain_n2):
        kept.setdefault(candidate.laws, candidate)
    return tuple(kept.values())
