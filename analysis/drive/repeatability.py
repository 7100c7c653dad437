"""The repeatability of a drive: the scatter of its force between cycles of a record, or records of one input.

A model of a drive is rarely limited by the white noise of the force; the limit is the drive's repeatability.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import BASE
from analysis.drive.regression import Regression, delay_of, rms
from analysis.drive.stretch import Table
from analysis.shot import Floats

ALIKE = 0.01  # difference of two passes, as a share of the displacement's spread, below which their motion is the same
MIN_OVERLAP = 0.25  # share of a record that a second pass must cover
_MIN_SAMPLES = 100


@dataclass(frozen=True, slots=True)
class Repeatability:
    """The lower limit of a model's force error; ``repeats``: observed between passes, otherwise only the noise."""

    force_n: float
    repeats: bool
    cycle_s: float | None = None  # period of the passes; None: they are records of one input

    def chi2(self, error_n: float) -> float:
        """Return the square of the ratio of an rms force error to the repeatability."""
        return (error_n / self.force_n) ** 2 if self.force_n > 0.0 else float("nan")


def repeatability_of(table: Table, found: Regression, noise_n: float) -> Repeatability:
    """Return the scatter between passes, or the noise ``noise_n`` of the filtered force if no motion is repeated.

    Passes never move exactly alike, so the force of mass and drag (from ``found``) is subtracted from each.
    """
    passes = [*_cycle_pairs(table), *_record_pairs(table)]
    modelled = table.base()[:, :2] @ np.array([found.quantity(name).value for name in BASE[:2]])
    force = table.force(delay_of(found.nonlinear)) - modelled
    differences = [force[late] - force[early] for early, late, _ in passes]
    if not differences:
        return Repeatability(noise_n, False)
    seen = rms(np.concatenate([d - d.mean() for d in differences])) / np.sqrt(2.0)
    return Repeatability(max(seen, noise_n), True, passes[0][2])


Pass = tuple[NDArray[np.int64], NDArray[np.int64], float | None]  # samples, their repeats, cycle in s


def _cycle_pairs(table: Table) -> Iterator[Pass]:
    """Yield (samples, those one cycle later) of every stretch that repeats itself."""
    start = 0
    for stretch in table.stretches:
        index = stretch.used // stretch.step - stretch.used[0] // stretch.step
        place = np.full(int(index[-1]) + 1, np.nan)
        place[index] = table.displacement_m[start : start + index.size]
        lag = _cycle_lag(place)
        if lag is not None:
            _, early, late = np.intersect1d(index + lag, index, assume_unique=True, return_indices=True)
            yield start + early, start + late, lag * stretch.step / stretch.sample_rate_hz
        start += index.size


def _cycle_lag(place: Floats) -> int | None:
    """Return the shortest lag in samples at which a displacement repeats itself, or None."""
    from scipy.signal import correlate  # slow import (all of scipy.stats): not at every start

    known = np.isfinite(place)
    if known.sum() < _MIN_SAMPLES:
        return None
    spread = float(np.std(place[known]))
    filled = np.where(known, place - place[known].mean(), 0.0)
    agree = correlate(filled, filled, mode="full", method="fft")[filled.size - 1 :]
    most = int((1.0 - MIN_OVERLAP) * place.size)
    agree = agree[:most] / np.arange(place.size, place.size - most, -1)
    peaks = 1 + np.flatnonzero((agree[1:-1] > agree[:-2]) & (agree[1:-1] >= agree[2:]) & (agree[1:-1] > 0.5 * agree[0]))
    for peak in peaks[:50]:
        about = 2 + int(peak) // 50  # the mean of an incomplete cycle shifts the peak
        near = range(max(1, int(peak) - about), min(most, int(peak) + about + 1))
        lag = min(near, key=lambda k: float(np.nanstd(place[k:] - place[:-k])))
        difference = place[lag:] - place[:-lag]
        if np.isfinite(difference).sum() > _MIN_SAMPLES and float(np.nanstd(difference)) < ALIKE * spread:
            return lag
    return None


def _record_pairs(table: Table) -> Iterator[Pass]:
    """Yield the samples of one record with those of another record with the same motion or the same force.

    Each record's time counts from its own first sample.
    """
    force = table.force()
    places = {int(record): _places(table, int(record)) for record in np.unique(table.record)}
    for one, other in itertools.combinations(places, 2):
        (rate, when, first), (other_rate, then, second) = places[one], places[other]
        if abs(other_rate / rate - 1.0) > 1e-6:
            continue
        common, a, b = np.intersect1d(when, then, assume_unique=True, return_indices=True)
        if common.size < max(_MIN_SAMPLES, MIN_OVERLAP * min(when.size, then.size)):
            continue
        a, b = first[a], second[b]
        moved = _relative_difference(table.displacement_m[a], table.displacement_m[b])
        driven = _relative_difference(force[a], force[b])
        if min(moved, driven) < ALIKE:
            yield a, b, None


def _places(table: Table, record: int) -> tuple[float, NDArray[np.int64], NDArray[np.int64]]:
    """Return a record's sample rate, its sample numbers from the record's start, and their indices in the table."""
    stretches = [stretch for stretch in table.stretches if stretch.record == record]
    rate, begin = stretches[0].sample_rate_hz, min(float(stretch.time_s[0]) for stretch in stretches)
    at = np.flatnonzero(table.record == record)
    return rate, np.round((table.time_s[at] - begin) * rate).astype(np.int64), at


def _relative_difference(one: Floats, other: Floats) -> float:
    spread = float(np.std(one))
    return float(np.std(other - one)) / spread if spread > 0.0 else np.inf


def folds(table: Table, count: int) -> NDArray[np.int64]:
    """Return the cross-validation fold of every sample, (m,): a part of the cycle, or of the record without cycles.

    A later cycle does not test a fit of an earlier cycle; a held-out part of the cycle does.
    """
    cycle_s = next((cycle for _, _, cycle in _cycle_pairs(table)), None)
    out = np.empty(table.time_s.size, dtype=np.int64)
    for record in np.unique(table.record):
        of = table.record == record
        time_s = table.time_s[of] - table.time_s[of][0]
        whole = cycle_s if cycle_s is not None else float(time_s[-1]) * (1.0 + 1e-9)
        out[of] = np.floor(count * np.mod(time_s, whole) / whole).astype(np.int64)
    return out
