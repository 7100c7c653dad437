"""Find the instant at which a contact begins or ends, from how the displacement departs from a free flight."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.reading.flight import Flight
from analysis.shot import Floats, Motion
from analysis.signal import LEAST_NOISE_M, first_run

Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

CLEAR_SIGMAS = 6.0  # a departure from flight beyond noise
SHAPED_SIGMAS = 200.0  # a departure that shows its shape to a per cent: it is fitted up to there
SHAPED_DEPTH = 3e-5  # ... or to this part of the way to the turn, before a stiff contact rebounds
FURTHER = 10.0  # times that departure: there a force that also bends describes it, and tells the instant better
DESCRIBED = 3.0  # of the standard deviation of chi^2, up to which it does
DEEP = 3e-3  # of the way to the turn: a departure that no floor makes
SHORTENED, SLOWER = 0.7, 1.1  # of the time that a plate without mass takes to be so far
LONGEST_REACH_S = 1.0e-3  # of flight before the edge, for the line from which the displacement departs
SLOW_RECORD_SAMPLES = 64  # ... or so many samples of a record at a few hundred Hz
BEND = 2  # degree of the line through the last millisecond of flight, where the floor's motion curves it
PLAINER = 1.1  # log of three: the prior odds of the model with one parameter fewer
PLAIN = 9.0  # of chi^2 that a curved line must gain
TRIALS = 64  # of the instant, and as many again where it is likely
LIKELY = 25.0  # of chi^2
FLIGHT_TRIALS = 28  # per side, for the two edges of a short flight together


@dataclass(frozen=True, slots=True)
class Edge:
    """A contact's first or last instant in s, with its standard uncertainty."""

    time_s: float
    std_s: float

    def less_sure(self, std_s: float) -> "Edge":
        """Return the edge with a further, independent standard uncertainty."""
        return Edge(self.time_s, float(np.hypot(self.std_s, std_s)))


def edge_of_flight(
    motion: Motion, flight: tuple[int, int], coarse: int, *, until: int, depth_m: float, guard_s: float
) -> Edge | None:
    """Return the contact's edge at the end of a flight (first, last sample), near sample ``coarse``.

    The line from which the displacement departs is fitted to the last millisecond of flight only, up to ``guard_s``
    before ``coarse``, so that the floor's motion curves it little.  A force ``a + b u`` at the time ``u`` beyond the
    edge makes a departure of ``(a/2) u^2 + (b/6) u^3`` (times 1/m); the edge is the instant of least squares over the
    samples up to a departure of SHAPED_SIGMAS, or SHAPED_DEPTH of the whole ``depth_m``, and not beyond ``until``.  The
    force grows away from the edge (b >= 0), and a contact begins with a push (a >= 0; a release may end in tension):
    else a flight could be taken for a contact without force.  A plate gives way as it is pushed: a touch is fitted up
    to a departure FURTHER with a third term, ``-(c/24) u^4`` (c >= 0), where that describes it; without, the instant
    would be late by half its uncertainty on a quiet floor.  None without a clear departure.
    """
    step = 1.0 / motion.sample_rate_hz
    into = until > coarse
    sign = 1 if into else -1
    until = min(max(until, 0), motion.time_s.size - 1)
    free = max(round(LONGEST_REACH_S / step), min(SLOW_RECORD_SAMPLES, flight[1] - flight[0]))
    guard = max(2, round(guard_s / step))
    inner = max(coarse - free - guard, flight[0]) if into else min(coarse + free + guard, flight[1])
    window = np.arange(inner, until + sign, sign)
    window = window[motion.valid[window] & np.isfinite(motion.displacement_m[window])]
    u = sign * (motion.time_s[window] - motion.time_s[coarse])
    straight = u < -guard * step
    if straight.sum() < 8:
        return None
    x = motion.displacement_m[window]
    bend = _bend_of(u[straight], x[straight] - x[0])
    departure = x - x[0] - np.polyval(np.polyfit(u[straight], x[straight] - x[0], bend), u)
    rest = departure[straight]
    std = float(np.sqrt(rest @ rest / (rest.size - bend - 1)))
    std = max(std, float(np.nanmedian(motion.displacement_std_m)), LEAST_NOISE_M)
    omega = abs(float(np.polyfit(u[straight], x[straight] - x[0], 1)[0])) / max(depth_m, 1e-12)  # of a half-sine
    most = SHAPED_SIGMAS * std
    if into:
        most = max(2.0 * CLEAR_SIGMAS * std, min(most, SHAPED_DEPTH * depth_m))
    found = None
    if into:
        found = _edge_with_error(motion, window, departure, (std, FURTHER * most, omega), sign, bend, bending=True)
    found = found or _edge_with_error(motion, window, departure, (std, most, omega), sign, bend)
    if found is None:
        return None
    edge, apart = found
    late_s = 0.0
    if into:
        late_s = _later(u - (edge.time_s - float(motion.time_s[coarse])), departure, std, depth_m, omega)
    return Edge(edge.time_s, float(np.linalg.norm((edge.std_s, apart, late_s))))


def _later(u_s: Floats, departure_m: Floats, std_m: float, depth_m: float, omega: float) -> float:
    """Return by how much a contact began later than at ``u_s`` = 0, where it comes too slowly for any; 0 where not.

    A departure D from flight takes at most the time of a plate without mass, whose half-sine of the whole ``depth_m``
    is (omega u)^3 / 6 of it deep; the mass of a plate only shortens that, of a twentieth of the block's to SHORTENED.
    Where it took longer, what bent the flight at first was something else: somebody struck the table.
    """
    deep_m = max(DEEP * depth_m, CLEAR_SIGMAS * std_m)
    deep = first_run(np.abs(departure_m) > deep_m, 3)
    if deep is None or deep == 0 or omega <= 0.0 or depth_m <= 0.0:
        return 0.0
    took_s, longest_s = float(u_s[deep - 1]), float(np.cbrt(6.0 * deep_m / depth_m)) / omega
    return took_s - SHORTENED * longest_s if took_s > SLOWER * longest_s else 0.0


_FEWEST = 8  # samples of a short flight
_FORCE_NUMBERS = 8  # that are fitted beside its line: two edges, a force of three terms on either side


def _bend_of(u_s: Floats, x_m: Floats) -> int:
    """Return the degree of the line through some flight: curved only where the floor's motion clearly curves it."""
    straight, bent = (float(np.sum((x_m - np.polyval(np.polyfit(u_s, x_m, k), u_s)) ** 2)) for k in (1, BEND))
    return BEND if straight - bent > PLAIN * bent / (u_s.size - BEND - 1) else 1


def edge_of_line(motion: Motion, line: Flight, *, until: int, bend: int) -> Edge | None:
    """Return the edge of a contact that leaves a flight's own line, on the side of sample ``until``.

    With ``bend`` the flight bends: a polynomial of that degree through it is found together with the edge, and what a
    shorter departure and one degree more say instead stands in the uncertainty.
    """
    sign = 1 if until > line.last else -1
    until = min(max(until, 0), motion.time_s.size - 1)
    window = np.arange(line.first if sign > 0 else line.last, until + sign, sign)
    window = window[motion.valid[window] & np.isfinite(motion.displacement_m[window])]
    departure = motion.displacement_m[window] - line.position_m(motion.time_s[window])
    std = max(line.noise_std_m, LEAST_NOISE_M)
    most = SHAPED_SIGMAS * std
    further = FURTHER * most if sign > 0 else most  # before a release the force turns over within so long
    found = _edge_with_error(motion, window, departure, (std, further, 0.0), sign, bend, bending=True)
    found = found or _edge_with_error(motion, window, departure, (std, most, 0.0), sign, bend)
    return None if found is None else found[0].less_sure(found[1])


def _edge_with_error(
    motion: Motion,
    window: Ints,
    departure_m: Floats,
    levels: tuple[float, float, float],
    sign: int,
    bend: int,
    *,
    bending: bool = False,
) -> tuple[Edge, float] | None:
    """Return ``_edge_in`` and, in s, the systematic error of the series and of the line, where that is not known.

    That is the edge's shift with a line of one degree more or, of a force that does not bend, a shorter departure.
    """
    edge = _edge_in(motion, window, departure_m, levels, sign, bend, bending=bending)
    if edge is None or bend == 0:
        return None if edge is None else (edge, 0.0)
    std_m, shaped_m, omega = levels
    others = [_edge_in(motion, window, departure_m, levels, sign, bend + 1, bending=bending)]
    if not bending:
        others.append(_edge_in(motion, window, departure_m, (std_m, shaped_m / 3.0, omega), sign, bend))
    return edge, max((abs(edge.time_s - other.time_s) for other in others if other is not None), default=0.0)


def _edge_in(
    motion: Motion,
    window: Ints,
    departure_m: Floats,
    levels: tuple[float, float, float],
    sign: int,
    bend: int,
    *,
    bending: bool = False,
) -> Edge | None:
    """Return the edge shown by a departure (n,) from flight, in the direction ``sign`` of time.

    ``levels`` are its noise and the departure up to which it is fitted, in m, and the angular frequency of the
    contact's spring; ``bend`` is the degree of the line that is fitted together with the edge, 0 where the line is
    known.  A ``bending`` force has a third term, which gives way at a touch and grows into the contact at a release,
    as the pull fades; it has to describe the departure.
    """
    std_m, shaped_m, omega = levels
    step = 1.0 / motion.sample_rate_hz
    clear = first_run(np.abs(departure_m) > CLEAR_SIGMAS * std_m, 3)
    if clear is None:
        return None
    shaped = first_run(np.abs(departure_m) > shaped_m, 3) or departure_m.size - 1
    shaped = min(max(shaped, clear + 6), departure_m.size - 1)
    # a departure that grows with the cube of the time began that long before it was clear
    growth = np.cbrt(max(abs(float(departure_m[shaped])), shaped_m) / (CLEAR_SIGMAS * std_m))
    reach = 1.5 * (shaped - clear) * max(1.0, 1.0 / max(growth - 1.0, 0.1)) + 3 if bend else 1.5 * (shaped - clear) + 3
    start = max(0, int(clear - 2.0 * reach - 24)) if bend == 0 else 0
    latest = max(0.5, shaped - clear - 4.0) if bend else 0.5  # the clear departure may have been the floor's
    anchor = float(motion.time_s[window[clear]])
    beyond = sign * (motion.time_s[window[start : shaped + 1]] - anchor)
    found = _least_squares_edge(
        beyond,
        departure_m[start : shaped + 1],
        std_m,
        (-reach * step, latest * step),
        (max(bend, 1), omega, -sign * bending),
        tension=sign < 0,
    )
    return None if found is None else Edge(anchor + sign * found.time_s, found.std_s)


def _least_squares_edge(
    u_s: Floats,
    departure_m: Floats,
    std_m: float,
    within_s: tuple[float, float],
    shape: tuple[int, float, int],
    *,
    tension: bool,
) -> Edge | None:
    bend, omega, bends = shape
    terms = 2 + abs(bends)
    if u_s.size < bend + 2 + terms or not np.any(u_s):
        return None
    trials = np.linspace(*within_s, TRIALS)
    # vibration of the building curves the flight beyond the known line: the line before the edge is fitted as well
    line, _ = np.linalg.qr(np.vander(u_s / np.abs(u_s).max(), bend + 1))
    scaled = departure_m / std_m
    scaled = scaled - line @ (line.T @ scaled)
    found: Edge | None = None
    for narrowing in range(2):
        flat = _force_terms(u_s[:, None] - trials, omega, bends).reshape(u_s.size, -1)
        flat -= line @ (line.T @ flat)
        costs = np.empty((trials.size, 2))
        _costs_of_one(_grams_of_each(flat, terms), flat.T @ scaled, float(scaled @ scaled), tension, costs)
        freedom = max(u_s.size - bend - 2 - terms, 1)
        least = max(1.0, float(costs.min()) / freedom)
        cost = _of_both(costs[:, 0], costs[:, 1], least, PLAINER)  # with a step of force and without
        best = int(cost.argmin())
        if best == 0 and narrowing == 0:
            return None
        beyond = int(np.count_nonzero(u_s > trials[best]))
        if bends and costs.min() > freedom + DESCRIBED * np.sqrt(2.0 * beyond):
            return None
        spread = float(np.sqrt(least))  # larger where the series does not describe the departure
        likely = np.flatnonzero(cost < cost[best] + LIKELY * spread**2)
        found = _likelihood_mean(trials, cost, spread)
        ends = np.clip([likely[0] - 1, likely[-1] + 1], 0, trials.size - 1)
        trials = np.linspace(float(trials[ends[0]]), float(trials[ends[1]]), TRIALS)
    return found


def edges_of_short_flight(
    time_s: Floats,
    displacement_m: Floats,
    std_m: float,
    release: tuple[float, float],
    onset: tuple[float, float],
    *,
    bend: int,
) -> tuple[Edge, Edge] | None:
    """Return release and onset of a short flight between two contacts, fitted together with its line.

    The line is a polynomial of degree ``bend``: 1, or 2 where the floor bends the flight.

    ``time_s`` and ``displacement_m`` (n,) span the flight and a little of the contact on either side; ``release`` and
    ``onset`` are the ranges in s that are searched.  None where an edge lies at the end of its range.
    The forces are those of ``edge_of_flight``, with third terms where those pay.  Cost: 2 FLIGHT_TRIALS^2 small
    least-squares solutions on each of two grids, 5 ms in all.
    """
    if time_s.size < _FEWEST:
        return None
    zero = float(time_s.mean())
    tau = time_s - zero
    line, _ = np.linalg.qr(np.vander(tau / np.abs(tau).max(), bend + 1))
    fitted = _FORCE_NUMBERS + bend + 1
    scaled = (displacement_m - displacement_m.mean()) / std_m
    scaled = scaled - line @ (line.T @ scaled)
    ranges = [np.linspace(*release, FLIGHT_TRIALS) - zero, np.linspace(*onset, FLIGHT_TRIALS) - zero]
    edges: list[Edge] = []
    for narrowing in range(2):
        terms = [_force_terms(ranges[0] - tau[:, None], bends=1), _force_terms(tau[:, None] - ranges[1], bends=-1)]
        flat = np.concatenate([side.reshape(tau.size, -1) for side in terms], axis=1)
        flat -= line @ (line.T @ flat)
        costs = np.empty((2, FLIGHT_TRIALS, FLIGHT_TRIALS))
        for without, each in enumerate(costs):
            _costs_of_two(flat.T @ flat, flat.T @ scaled, float(scaled @ scaled), 3 - without, each)
        least = max(1.0, float(costs.min()) / max(tau.size - fitted, 1))
        cost = _of_both(costs[0], costs[1], least, 2.0 * PLAINER)
        cost[ranges[1][None, :] <= ranges[0][:, None]] = np.inf
        i, j = (int(k) for k in np.unravel_index(int(cost.argmin()), cost.shape))
        if narrowing == 0 and (i == 0 or j == FLIGHT_TRIALS - 1):
            return None  # the flight is longer than its range allows: the range was wrong
        spread = float(np.sqrt(least))
        edges = [_likelihood_mean(grid, cost.min(axis=1 - axis), spread) for axis, grid in enumerate(ranges)]
        widths = [max(3.0 * e.std_s, 2.0 * float(g[1] - g[0])) for e, g in zip(edges, ranges, strict=True)]
        ranges = [np.linspace(e.time_s - w, e.time_s + w, FLIGHT_TRIALS) for e, w in zip(edges, widths, strict=True)]
    first, second = edges
    return Edge(first.time_s + zero, first.std_s), Edge(second.time_s + zero, second.std_s)


def _of_both(full: Floats, plain: Floats, least: float, plainer: float) -> Floats:
    """Return -2 ln L of two models together, the one with fewer parameters ``plainer`` ahead in log prior odds.

    ``full`` and ``plain`` are what each leaves of the squares at every trial; ``least`` is the variance in their unit.
    """
    return np.asarray(-2.0 * least * np.logaddexp(-0.5 * full / least, plainer - 0.5 * plain / least))


def _force_terms(u_s: Floats, omega: float = 0.0, bends: int = 0) -> Floats:
    """Return the departures of a step and of a slope of force at u = 0, scaled to about 1: (n, k) gives (n, k, 2 or 3).

    Where the force ``bends`` (1 or -1) also that of one that grows or falls with the square of the time.  With
    ``omega`` step and slope are those of a spring: 2 (1 - cos) and 6 (x - sin x), to the fourth order.
    """
    since = np.maximum(u_s, 0.0)
    u = since / np.maximum(since.max(axis=0), 1e-300)
    out = np.empty((*u.shape, 2 + abs(bends)))
    out[..., 0] = u * u
    out[..., 1] = out[..., 0] * u
    if bends:
        out[..., 2] = bends * out[..., 1] * u
    if omega:
        square = (omega * since) ** 2
        out[..., 0] *= 1.0 - square / 12.0 + square**2 / 360.0
        out[..., 1] *= 1.0 - square / 20.0 + square**2 / 840.0
    return out


def _grams_of_each(flat: Floats, terms: int) -> Floats:
    """Return the products of each trial's terms with each other, (trials, terms, terms), of (n, terms trials)."""
    of_trial = flat.reshape(flat.shape[0], -1, terms).transpose(1, 2, 0)
    return of_trial @ of_trial.transpose(0, 2, 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _costs_of_one(gram: Floats, across: Floats, whole: float, tension: bool, cost: Floats) -> None:
    """Write what all terms of the force leave of the squares at every trial, and all but its step, (trials, 2).

    ``gram`` (trials, k, k) and ``across`` (k trials,) hold a trial's k terms.  About 0.2 us a trial of two.
    """
    terms = gram.shape[1]
    index, free = np.arange(terms), np.zeros(terms, np.bool_)
    free[0] = tension
    for k in range(cost.shape[0]):
        mine = across[terms * k : terms * (k + 1)]
        cost[k, 0] = whole - _explained(gram[k], mine, index, free)
        cost[k, 1] = whole - _explained(gram[k], mine, index[1:], free[1:])


@njit(cache=True, nogil=True, error_model="numpy")
def _costs_of_two(gram: Floats, across: Floats, whole: float, terms: int, cost: Floats) -> None:
    """Write the same for every pair of a release (columns first) and an onset (columns after), with 2 or 3 terms each.

    A force has three columns.  About 2 us a pair with two terms each, 6 us with three.
    """
    rows, columns = cost.shape
    index, free = np.empty(2 * terms, np.int64), np.zeros(2 * terms, np.bool_)
    free[0] = True
    for i in range(rows):
        for k in range(terms):
            index[k] = 3 * i + k
        for j in range(columns):
            for k in range(terms):
                index[terms + k] = 3 * (rows + j) + k
            cost[i, j] = whole - _explained(gram, across, index, free)


@njit(cache=True, nogil=True, error_model="numpy")
def _explained(gram: Floats, across: Floats, index: Ints, free: Mask) -> float:
    """Return the most that columns ``index`` explain, their coefficients >= 0 but for the ``free``.

    Where the best coefficients of a subset are not allowed, one of those that are negative is zero at the best that
    are: so subsets are left out one column at a time, from all of them on.  About 0.1 us a subset of three.
    """
    n = index.size
    best = 0.0
    matrix, right, used = np.empty((n, n)), np.empty(n), np.empty(n, np.int64)
    known, waiting = np.zeros(1 << n, np.bool_), np.empty(1 << n, np.int64)
    waiting[0], known[-1], left = (1 << n) - 1, True, 1
    while left:
        left -= 1
        subset = waiting[left]
        m = 0
        for k in range(n):
            if (subset >> k) & 1:
                used[m] = k
                m += 1
        for a in range(m):
            right[a] = across[index[used[a]]]
            for b in range(m):
                matrix[a, b] = gram[index[used[a]], index[used[b]]]
        sound = True
        for a in range(m):
            if not matrix[a, a] > 1e-10 * gram[index[used[a]], index[used[a]]]:
                sound = False
                break
            for b in range(a + 1, m):
                factor = matrix[b, a] / matrix[a, a]
                right[b] -= factor * right[a]
                for c in range(a, m):
                    matrix[b, c] -= factor * matrix[a, c]
        gain = 0.0
        if sound:
            for a in range(m - 1, -1, -1):
                total = right[a]
                for b in range(a + 1, m):
                    total -= matrix[a, b] * right[b]
                right[a] = total / matrix[a, a]
                gain += right[a] * across[index[used[a]]]
            if gain <= best:
                continue
        allowed = sound
        for a in range(m):
            if not sound or (right[a] < 0.0 and not free[used[a]]):
                allowed = False
                fewer = subset & ~(1 << used[a])
                if not known[fewer]:
                    known[fewer] = True
                    waiting[left] = fewer
                    left += 1
        if allowed:
            best = gain
    return best


def _likelihood_mean(trials: Floats, cost: Floats, spread: float) -> Edge:
    """Return mean and standard deviation of the instant, trials weighed by their likelihood exp(-chi2/2).

    Where two instants explain the record almost equally, the uncertainty covers both.
    """
    weight = np.exp(-0.5 * (cost - cost.min()) / spread**2)
    weight /= weight.sum()
    mean = float(weight @ trials)
    step = float(trials[1] - trials[0])
    return Edge(mean, float(np.sqrt(weight @ (trials - mean) ** 2 + step**2 / 12.0)))
