"""The instant at which a contact begins or ends, from how the displacement leaves a free flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.motion import Motion
from analysis.reading.flights import Flight

Floats = NDArray[np.float64]

CLEAR_SIGMAS = 6.0  # a departure from flight that is no noise
SHAPED_SIGMAS = 100.0  # a departure whose shape is known to a per cent: followed so far, no farther
LONGEST_REACH_S = 1.0e-3
TRIALS = 96
FLIGHT_TRIALS = 28  # a side, for the two edges of a short flight together


@dataclass(frozen=True, slots=True)
class Edge:
    """A contact's first or last instant in s, with its standard uncertainty."""

    time_s: float
    std_s: float


def edge_of_flight(motion: Motion, flight: Flight, *, last: bool) -> Edge | None:
    """Return the contact's edge after (``last``) or before a flight, by the flight's own noise.

    The force's Taylor series at the edge, step, slope and curvature, makes the departure from flight
    ``a u^2 + b u^3 + c u^4`` with ``u`` the time beyond the edge; the edge is the instant that leaves the least
    squares over the samples up to a departure of 100 sigma.  None where the record shows no clear departure.
    """
    std = max(flight.noise_std_m, 1e-15)
    step = 1.0 / motion.sample_rate_hz
    longest = round(LONGEST_REACH_S / step) + 64
    inner = max(flight.last - longest, flight.first) if last else min(flight.first + longest, flight.last)
    outer = flight.last + longest if last else flight.first - longest
    outer = min(max(outer, 0), motion.time_s.size - 1)
    window = np.arange(inner, outer + 1) if last else np.arange(inner, outer - 1, -1)
    window = window[motion.valid[window]]
    departure = motion.displacement_m[window] - flight.position_m(motion.time_s[window])
    clear = _first_run(np.abs(departure) > CLEAR_SIGMAS * std)
    if clear is None:
        return None
    shaped = _first_run(np.abs(departure) > SHAPED_SIGMAS * std) or departure.size - 1
    shaped = min(max(shaped, clear + 6), departure.size - 1)
    reach = 1.5 * (shaped - clear) + 3
    start = max(0, int(clear - reach - 12))
    sign = 1.0 if last else -1.0
    anchor = float(motion.time_s[window[clear]])
    beyond = sign * (motion.time_s[window[start : shaped + 1]] - anchor)
    found = _least_squares_edge(beyond, departure[start : shaped + 1], std, -reach * step, 0.5 * step)
    return None if found is None else Edge(anchor + sign * found.time_s, found.std_s)


def _first_run(mask: NDArray[np.bool_]) -> int | None:
    """Return the first index from which three samples in a row are True."""
    three = np.flatnonzero(mask[:-2] & mask[1:-1] & mask[2:]) if mask.size > 2 else np.empty(0, int)
    return int(three[0]) if three.size else None


def _least_squares_edge(u_s: Floats, departure_m: Floats, std_m: float, low_s: float, high_s: float) -> Edge | None:
    trials = np.linspace(low_s, high_s, TRIALS)
    cost = np.array([_left_over([_force_terms(u_s - t)], departure_m) for t in trials]) / std_m**2
    best = int(cost.argmin())
    if best in (0, trials.size - 1):
        return None
    spread = max(1.0, float(np.sqrt(cost[best] / max(u_s.size - 4, 1))))  # the series is only a series
    return Edge(float(trials[best]), _half_width(trials, cost) * spread)


def edges_of_short_flight(
    time_s: Floats, displacement_m: Floats, std_m: float, release: tuple[float, float], onset: tuple[float, float]
) -> tuple[Edge, Edge] | None:
    """Return release and onset around a short flight between two contacts, fitted together with its straight line.

    ``time_s`` and ``displacement_m`` (n,) span the flight and a little of the contact on either side; ``release`` and
    ``onset`` are the ranges in s to look in.  None where an edge lies at the end of its range.
    Cost: FLIGHT_TRIALS^2 least-squares solutions of n x 8, on two grids.
    """
    zero = float(time_s.mean())
    tau = time_s - zero
    line = np.stack([np.ones_like(tau), tau / np.abs(tau).max()], axis=1)
    ranges = [np.linspace(*release, FLIGHT_TRIALS) - zero, np.linspace(*onset, FLIGHT_TRIALS) - zero]
    for narrowing in range(2):
        cost = np.full((FLIGHT_TRIALS, FLIGHT_TRIALS), np.inf)
        for i, r in enumerate(ranges[0]):
            before = _force_terms(r - tau)
            for j, o in enumerate(ranges[1]):
                if o > r:
                    cost[i, j] = _left_over([line, before, _force_terms(tau - o)], displacement_m)
        i, j = (int(k) for k in np.unravel_index(int(cost.argmin()), cost.shape))
        if narrowing == 0 and (i in (0, FLIGHT_TRIALS - 1) or j in (0, FLIGHT_TRIALS - 1)):
            return None
        cost /= std_m**2
        edges = tuple(
            Edge(float(grid[k]) + zero, _half_width(grid, cost.min(axis=1 - axis)))
            for axis, (grid, k) in enumerate(zip(ranges, (i, j), strict=True))
        )
        widths = [max(4.0 * e.std_s, 3.0 * float(g[1] - g[0])) for e, g in zip(edges, ranges, strict=True)]
        ranges = [
            np.linspace(e.time_s - zero - w, e.time_s - zero + w, FLIGHT_TRIALS)
            for e, w in zip(edges, widths, strict=True)
        ]
    spread = max(1.0, float(np.sqrt(cost.min() / max(tau.size - 10, 1))))
    first, second = edges
    return Edge(first.time_s, first.std_s * spread), Edge(second.time_s, second.std_s * spread)


def _force_terms(u_s: Floats) -> Floats:
    """Return u^2, u^3, u^4 of the time beyond an edge, zero before it, scaled to 1; shape (n, 3)."""
    u = np.maximum(u_s, 0.0)
    scale = float(u.max())
    if scale <= 0.0:
        return np.zeros((u.size, 3))
    u = u / scale
    return np.stack([u**2, u**3, u**4], axis=1)


def _left_over(parts: list[Floats], values: Floats) -> float:
    design = np.concatenate(parts, axis=1)
    norms = np.linalg.norm(design, axis=0)
    design = design[:, norms > 0.0] / norms[norms > 0.0]
    solution, *_ = np.linalg.lstsq(design, values, rcond=None)
    residual = values - design @ solution
    return float(residual @ residual)


def _half_width(trials: Floats, cost: Floats) -> float:
    """Return the distance over which a profile of chi-squared rises by one."""
    best = int(cost.argmin())
    left = np.flatnonzero(cost[:best] > cost[best] + 1.0)
    right = np.flatnonzero(cost[best:] > cost[best] + 1.0)
    low = trials[left[-1]] if left.size else trials[0]
    high = trials[best + right[0]] if right.size else trials[-1]
    return float(high - low) / 2.0
