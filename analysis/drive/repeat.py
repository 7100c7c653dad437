"""What a drive repeats to: the scatter between cycles of one record, or between records of one input, as a force.

The white noise of the force is rarely what limits a model of a drive; how far the drive does the same twice is.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import BASE
from analysis.drive.regress import Regression, delay_of, rms
from analysis.drive.table import Table

Floats = NDArray[np.float64]
ALIKE = 0.01  # of the displacement's spread: two passes that differ by less are the same motion
LEAST_OVERLAP = 0.25  # of a record, that a second pass must cover
_LEAST_SAMPLES = 100


@dataclass(frozen=True, slots=True)
class Floor:
    """The error below which nothing is asked of a model; ``repeats`` says whether it was seen between passes."""

    force_n: float
    repeats: bool
    what: str
    cycle_s: float | None = None


def floor(table: Table, found: Regression, noise_n: float) -> Floor:
    """Return what the drive repeats to, else the noise ``noise_n`` of the filtered force.

    The passes never move quite alike: what mass and drag of ``found`` make of the difference is taken off.
    """
    passes = [*_cycles(table), *_records(table)]
    modelled = table.base()[:, :2] @ np.array([found.quantity(name).value for name in BASE[:2]])
    force = table.force(delay_of(found.bent)) - modelled
    differences = [force[late] - force[early] for early, late, _, _ in passes]
    if not differences:
        return Floor(noise_n, False, "the noise of the force in this band")
    seen = rms(np.concatenate([d - d.mean() for d in differences])) / np.sqrt(2.0)
    _, _, what, cycle_s = passes[0]
    return Floor(max(seen, noise_n), True, what, cycle_s)


def period(table: Table) -> float | None:
    """Return the time in s after which the first record does the same again, or None."""
    return next((cycle_s for _, _, _, cycle_s in _cycles(table)), None)


Pass = tuple[NDArray[np.int64], NDArray[np.int64], str, float | None]


def _cycles(table: Table) -> Iterator[Pass]:
    """Yield (samples, the same a cycle later) of every run that repeats itself."""
    start = 0
    for run in table.runs:
        size = run.used.size
        index = run.used // run.step
        place = np.full(int(index[-1] - index[0]) + 1, np.nan)
        at = np.full(place.size, -1, dtype=np.int64)
        place[index - index[0]] = table.displacement_m[start : start + size]
        at[index - index[0]] = np.arange(start, start + size)
        start += size
        lag = _lag(place)
        if lag is None:
            continue
        both = (at[:-lag] >= 0) & (at[lag:] >= 0)
        cycle_s = lag * run.step / run.sample_rate_hz
        yield at[:-lag][both], at[lag:][both], f"what its cycle of {cycle_s:.4g} s repeats to", cycle_s


def _lag(place: Floats) -> int | None:
    """Return the shortest lag at which a displacement does the same again."""
    from scipy.signal import correlate  # with all of scipy.stats: not at every start

    known = np.isfinite(place)
    if known.sum() < _LEAST_SAMPLES:
        return None
    spread = float(np.std(place[known]))
    filled = np.where(known, place - place[known].mean(), 0.0)
    agree = correlate(filled, filled, mode="full", method="fft")[filled.size - 1 :]
    most = int((1.0 - LEAST_OVERLAP) * place.size)
    agree = agree[:most] / np.arange(place.size, place.size - most, -1)
    peaks = 1 + np.flatnonzero((agree[1:-1] > agree[:-2]) & (agree[1:-1] >= agree[2:]) & (agree[1:-1] > 0.5 * agree[0]))
    for peak in peaks[:50]:
        about = 2 + int(peak) // 50  # the mean of a broken cycle draws the peak aside
        near = range(max(1, int(peak) - about), min(most, int(peak) + about + 1))
        lag = min(near, key=lambda k: float(np.nanstd(place[k:] - place[:-k])))
        difference = place[lag:] - place[:-lag]
        if np.isfinite(difference).sum() > _LEAST_SAMPLES and float(np.nanstd(difference)) < ALIKE * spread:
            return lag
    return None


def _records(table: Table) -> Iterator[Pass]:
    """Yield (samples, the same of another record) where two records share their motion or their force.

    Each record's time counts from its own beginning, whatever its clock says.
    """
    force = table.force()
    places = {int(record): _places(table, int(record)) for record in np.unique(table.record)}
    for one, other in itertools.combinations(places, 2):
        (rate, when, first), (other_rate, then, second) = places[one], places[other]
        if abs(other_rate / rate - 1.0) > 1e-6:
            continue
        common, a, b = np.intersect1d(when, then, assume_unique=True, return_indices=True)
        if common.size < max(_LEAST_SAMPLES, LEAST_OVERLAP * min(when.size, then.size)):
            continue
        a, b = first[a], second[b]
        moved = _share(table.displacement_m[a], table.displacement_m[b])
        driven = _share(force[a], force[b])
        if min(moved, driven) < ALIKE:
            yield a, b, "what records of one input repeat to", None


def _places(table: Table, record: int) -> tuple[float, NDArray[np.int64], NDArray[np.int64]]:
    """Return a record's sample rate, its samples' numbers from its beginning, and their places in the table."""
    runs = [run for run in table.runs if run.record == record]
    rate, begin = runs[0].sample_rate_hz, min(float(run.time_s[0]) for run in runs)
    at = np.flatnonzero(table.record == record)
    return rate, np.round((table.time_s[at] - begin) * rate).astype(np.int64), at


def _share(one: Floats, other: Floats) -> float:
    spread = float(np.std(one))
    return float(np.std(other - one)) / spread if spread > 0.0 else np.inf


def folds(table: Table, count: int) -> NDArray[np.int64]:
    """Return a fold for every sample, shape (m,): parts of the cycle where the motion repeats, else of the time.

    A later cycle foretells nothing that an earlier one did not hold; a part of the cycle that was left out does.
    """
    cycle_s = period(table)
    out = np.empty(table.time_s.size, dtype=np.int64)
    for record in np.unique(table.record):
        of = table.record == record
        time_s = table.time_s[of] - table.time_s[of][0]
        whole = cycle_s if cycle_s is not None else float(time_s[-1]) * (1.0 + 1e-9)
        out[of] = np.floor(count * np.mod(time_s, whole) / whole).astype(np.int64)
    return out
