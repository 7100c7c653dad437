"""The instant at which a contact begins or ends, from how the displacement leaves a free flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from analysis.motion import Motion
from analysis.reading.flights import Flight

Floats = NDArray[np.float64]

CLEAR_SIGMAS = 6.0  # a departure from flight that is no noise
SHAPED_SIGMAS = 200.0  # a departure whose shape is known to a per cent: followed so far, no farther
LONGEST_REACH_S = 1.0e-3  # of flight before the edge, for the line the force departs from
SLOW_RECORD_SAMPLES = 64  # ... or so many samples of a record at a few hundred Hz
TRIALS = 96
FLIGHT_TRIALS = 28  # a side, for the two edges of a short flight together


@dataclass(frozen=True, slots=True)
class Edge:
    """A contact's first or last instant in s, with its standard uncertainty."""

    time_s: float
    std_s: float


def edge_of_flight(motion: Motion, flight: Flight, *, until: int) -> Edge | None:
    """Return the contact's edge after or before a flight: the one on the side of sample ``until``.

    A force ``a + b u`` at the time ``u`` beyond the edge makes the departure from flight ``(a/2) u^2 + (b/6) u^3``
    (times 1/m); the edge is the instant that leaves the least squares over the samples up to a departure of
    SHAPED_SIGMAS.  The force grows away from the edge (b >= 0), and a contact begins with a push (a >= 0; a release
    may end in tension): without that a flight could be mistaken for a contact of no force.
    Nothing beyond ``until`` is looked at.  None where the record shows no clear departure.
    """
    std = max(flight.noise_std_m, 1e-15)
    step = 1.0 / motion.sample_rate_hz
    last = until > flight.last
    until = min(max(until, 0), motion.time_s.size - 1)
    free = max(round(LONGEST_REACH_S / step), SLOW_RECORD_SAMPLES)
    inner = max(flight.last - free, flight.first) if last else min(flight.first + free, flight.last)
    window = np.arange(inner, until + 1) if last else np.arange(inner, until - 1, -1)
    window = window[motion.valid[window]]
    departure = motion.displacement_m[window] - flight.position_m(motion.time_s[window])
    clear = _first_run(np.abs(departure) > CLEAR_SIGMAS * std)
    if clear is None:
        return None
    shaped = _first_run(np.abs(departure) > SHAPED_SIGMAS * std) or departure.size - 1
    shaped = min(max(shaped, clear + 6), departure.size - 1)
    reach = 1.5 * (shaped - clear) + 3
    start = max(0, int(clear - 2.0 * reach - 24))
    sign = 1.0 if last else -1.0
    anchor = float(motion.time_s[window[clear]])
    beyond = sign * (motion.time_s[window[start : shaped + 1]] - anchor)
    found = _least_squares_edge(beyond, departure[start : shaped + 1], std, -reach * step, 0.5 * step, tension=not last)
    return None if found is None else Edge(anchor + sign * found.time_s, found.std_s)


def _first_run(mask: NDArray[np.bool_]) -> int | None:
    """Return the first index from which three samples in a row are True."""
    three = np.flatnonzero(mask[:-2] & mask[1:-1] & mask[2:]) if mask.size > 2 else np.empty(0, int)
    return int(three[0]) if three.size else None


def _least_squares_edge(
    u_s: Floats, departure_m: Floats, std_m: float, low_s: float, high_s: float, *, tension: bool
) -> Edge | None:
    trials = np.linspace(low_s, high_s, TRIALS)
    # vibration of the building bends the flight's continuation a little: let the line before the edge be its own
    line, _ = np.linalg.qr(np.stack([np.ones_like(u_s), u_s / np.abs(u_s).max()], axis=1))
    scaled = departure_m / std_m
    scaled = scaled - line @ (line.T @ scaled)
    cost = np.empty(trials.size)
    for k, trial in enumerate(trials):
        terms = _force_terms(u_s - trial, tension=tension)
        cost[k] = nnls(terms - line @ (line.T @ terms), scaled)[1] ** 2
    best = int(cost.argmin())
    if best == 0:
        return None
    spread = max(1.0, float(np.sqrt(cost[best] / max(u_s.size - 5, 1))))  # the series is only a series
    return _weighed(trials, cost, spread)


def edges_of_short_flight(
    time_s: Floats, displacement_m: Floats, std_m: float, release: tuple[float, float], onset: tuple[float, float]
) -> tuple[Edge, Edge] | None:
    """Return release and onset around a short flight between two contacts, fitted together with its straight line.

    ``time_s`` and ``displacement_m`` (n,) span the flight and a little of the contact on either side; ``release`` and
    ``onset`` are the ranges in s to look in.  None where an edge lies at the end of its range.
    Cost: FLIGHT_TRIALS^2 non-negative least-squares solutions of n x 5, on two grids.
    """
    zero = float(time_s.mean())
    tau = time_s - zero
    line, _ = np.linalg.qr(np.stack([np.ones_like(tau), tau / np.abs(tau).max()], axis=1))
    scaled = (displacement_m - displacement_m.mean()) / std_m
    scaled = scaled - line @ (line.T @ scaled)
    ranges = [np.linspace(*release, FLIGHT_TRIALS) - zero, np.linspace(*onset, FLIGHT_TRIALS) - zero]
    edges: list[Edge] = []
    for narrowing in range(2):
        sides = [[_force_terms(r - tau, tension=True) for r in ranges[0]], [_force_terms(tau - o) for o in ranges[1]]]
        sides = [[terms - line @ (line.T @ terms) for terms in side] for side in sides]
        cost = np.full((FLIGHT_TRIALS, FLIGHT_TRIALS), np.inf)
        for i, r in enumerate(ranges[0]):
            for j, o in enumerate(ranges[1]):
                if o > r:
                    cost[i, j] = nnls(np.concatenate([sides[0][i], sides[1][j]], axis=1), scaled)[1] ** 2
        i, j = (int(k) for k in np.unravel_index(int(cost.argmin()), cost.shape))
        if narrowing == 0 and (i == 0 or j == FLIGHT_TRIALS - 1):
            return None  # the flight is longer than its range allows: the range was wrong
        spread = max(1.0, float(np.sqrt(cost.min() / max(tau.size - 8, 1))))
        edges = [_weighed(grid, cost.min(axis=1 - axis), spread) for axis, grid in enumerate(ranges)]
        widths = [max(3.0 * e.std_s, 2.0 * float(g[1] - g[0])) for e, g in zip(edges, ranges, strict=True)]
        ranges = [np.linspace(e.time_s - w, e.time_s + w, FLIGHT_TRIALS) for e, w in zip(edges, widths, strict=True)]
    first, second = edges
    return Edge(first.time_s + zero, first.std_s), Edge(second.time_s + zero, second.std_s)


def _force_terms(u_s: Floats, *, tension: bool = False) -> Floats:
    """Return the departures of a step and of a slope of force at u = 0, scaled to 1: shape (n, 2).

    With ``tension`` a third column lets the step be negative in a non-negative least-squares solution.
    """
    u = np.maximum(u_s, 0.0)
    scale = float(u.max())
    if scale <= 0.0:
        return np.zeros((u.size, 3 if tension else 2))
    u = u / scale
    return np.stack([u**2, u**3, -(u**2)] if tension else [u**2, u**3], axis=1)


def _weighed(trials: Floats, cost: Floats, spread: float) -> Edge:
    """Return mean and standard deviation of the instant, each trial weighed by its likelihood exp(-chi2/2).

    Where two instants explain the record almost alike, the uncertainty spans both.
    """
    weight = np.exp(-0.5 * (cost - cost.min()) / spread**2)
    weight /= weight.sum()
    mean = float(weight @ trials)
    step = float(trials[1] - trials[0])
    return Edge(mean, float(np.sqrt(weight @ (trials - mean) ** 2 + step**2 / 12.0)))
