"""Estimate by how much each law, and each pair of laws, would reduce the residual, before any fit.

Pairs are screened as well as single laws, because two laws may be visible only together: without friction near rest, a
delay alone makes a drive's fit worse.  A law's columns at every point of its grid are made orthogonal to the fitted
model and projected onto the residual.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.drive.catalogue import LAWS, Law
from analysis.drive.regression import DEPENDENT, ZERO_LENGTH, NonlinearValues, Regression, delay_of
from analysis.drive.stretch import Mask, Stretch, Table, low_pass
from analysis.shot import Floats

MAX_WAVES = 400.0  # waves along the travel of the finest ripple that is searched
WAVE_STEP = 0.4
RIPPLES = 3
APART_FROM_FORCE = 0.1  # least share orthogonal to the force, of a law computed from it; otherwise circular


@dataclass(frozen=True, slots=True)
class CandidateLaws:
    """Laws to add, starting values of their nonlinear parameters, and the sum of squares that they would remove."""

    laws: tuple[str, ...]
    nonlinear: NonlinearValues
    gain_n2: float


@dataclass(frozen=True, slots=True)
class ScreenedLaws:
    """Candidates, best first, and the laws that depend linearly on the model in this motion, whatever their values."""

    singles: tuple[CandidateLaws, ...]
    pairs: tuple[CandidateLaws, ...]
    unidentifiable: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Group:
    law: str
    nonlinear: tuple[float, ...]
    columns: Floats  # orthonormal, and orthogonal to the model


def screen_laws(
    table: Table, found: Regression, *, pairs: bool = True, laws: Sequence[str] = tuple(LAWS)
) -> ScreenedLaws:
    """Screen those of ``laws`` that are not in the fit ``found``, over the samples of that fit."""
    mask = found.mask
    basis = orthonormal(found.tangents[mask])
    rest = project_out(basis, found.residual_n[mask][:, None])[:, 0]
    missing = [LAWS[name] for name in laws if name not in found.laws]
    groups: list[_Group] = []
    unidentifiable = []
    for law in (law for law in missing if law.force is not None):
        some = _groups(table, law, mask, basis, rest)
        groups += [group for group in some if group is not None]
        if some and not any(some):
            unidentifiable.append(law.name)
    later = _delayed(table, found, basis) if "drive_delay" in laws and "drive_delay" not in found.laws else {}
    singles = [CandidateLaws((g.law,), _nonlinear(g), _square(g.columns.T @ rest)) for g in groups]
    size = _square(rest)
    singles += [CandidateLaws(("drive_delay",), {"drive_delay": (t,)}, size - _square(r)) for t, r in later.items()]
    both = list(_pairs(groups, rest, later)) if pairs else []
    return ScreenedLaws(_best(singles), _best(both), tuple(unidentifiable))


def _groups(table: Table, law: Law, mask: Mask, basis: Floats, rest: Floats) -> list[_Group | None]:
    """Return a law's columns at every point of its grid; None where they depend linearly on the model."""
    ripple = law.name == "position_ripple"
    places = _ripple_pitches(table, mask, basis, rest) if ripple else grid_points(law, table.stretches)
    return [_group(table, law, at, mask, basis) for at in places]


def grid_points(law: Law, stretches: Sequence[Stretch]) -> list[tuple[float, ...]]:
    """Return the points of a law's grid, in the parameters' units."""
    axes = [
        [share * parameter.scale_in(stretches) for share in parameter.grid] for parameter in law.nonlinear_parameters
    ]
    return list(itertools.product(*axes))


def project_out(basis: Floats, columns: Floats) -> Floats:
    """Return columns (m, k) minus their projection onto an orthonormal basis (m, j)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def orthonormal(columns: Floats) -> Floats:
    """Return an orthonormal basis of columns (m, k)."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), ZERO_LENGTH)
    return np.asarray(np.linalg.qr(columns / scale)[0])


def _group(table: Table, law: Law, nonlinear: tuple[float, ...], mask: Mask, basis: Floats) -> _Group | None:
    columns = table.columns(law, nonlinear)[mask]
    size = np.linalg.norm(columns, axis=0)
    if not (size > 0.0).all():
        return None
    alone = project_out(basis, columns / size)
    left, strength, _ = np.linalg.svd(alone, full_matrices=False)
    seen = strength > DEPENDENT**0.5
    if law.of_force:
        force = orthonormal(project_out(basis, table.force()[mask][:, None]))
        seen &= np.linalg.norm(project_out(force, alone)) > APART_FROM_FORCE
    return _Group(law.name, nonlinear, left[:, seen]) if seen.all() else None


def _delayed(table: Table, found: Regression, basis: Floats) -> dict[float, Floats]:
    """Return the residuals for a delayed or advanced force, as a mapping from the delay in s."""
    law = LAWS["drive_delay"]
    now = table.force(delay_of(found.nonlinear))[found.mask]
    rest = found.residual_n[found.mask]
    out = {}
    for (at,) in grid_points(law, table.stretches):
        if at != 0.0:
            out[at] = project_out(basis, (rest + table.force(at)[found.mask] - now)[:, None])[:, 0]
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


def _pairs(groups: Sequence[_Group], rest: Floats, later: Mapping[float, Floats]) -> Iterator[CandidateLaws]:
    if not groups:
        return
    every = np.concatenate([group.columns for group in groups], axis=1)
    ends = np.cumsum([0, *(group.columns.shape[1] for group in groups)])
    gram, pull = every.T @ every, every.T @ rest
    for i, j in itertools.combinations(range(len(groups)), 2):
        if groups[i].law == groups[j].law:
            continue
        a, b = slice(ends[i], ends[i + 1]), slice(ends[j], ends[j + 1])
        cross = gram[a, b]
        inner = np.eye(cross.shape[1]) - cross.T @ cross  # of b after orthogonalisation to a
        if np.linalg.eigvalsh(inner)[0] < 1e-4:
            continue
        new = pull[b] - cross.T @ pull[a]
        gain = _square(pull[a]) + float(new @ np.linalg.solve(inner, new))
        yield CandidateLaws((groups[i].law, groups[j].law), {**_nonlinear(groups[i]), **_nonlinear(groups[j])}, gain)
    size = _square(rest)
    for time_s, moved in later.items():
        pulls = every.T @ moved
        left = size - _square(moved)
        for k, group in enumerate(groups):
            gain = left + _square(pulls[ends[k] : ends[k + 1]])
            yield CandidateLaws((group.law, "drive_delay"), {**_nonlinear(group), "drive_delay": (time_s,)}, gain)


def _nonlinear(group: _Group) -> dict[str, tuple[float, ...]]:
    return {group.law: group.nonlinear} if group.nonlinear else {}


def _square(vector: Floats) -> float:
    return float(vector @ vector)


def _best(candidates: Sequence[CandidateLaws]) -> tuple[CandidateLaws, ...]:
    """Return the best candidate of every set of laws, best first."""
    kept: dict[tuple[str, ...], CandidateLaws] = {}
    for candidate in sorted(candidates, key=lambda g: -g.gain_n2):
        kept.setdefault(candidate.laws, candidate)
    return tuple(kept.values())
