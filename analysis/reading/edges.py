"""Find the instant at which a contact begins or ends, from the displacement's departure from a free flight."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.reading.flight import Flight
from analysis.shot import Floats, Motion
from analysis.signal import MIN_NOISE_M, first_run

Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

CLEAR_SIGMAS = 6.0  # departure from flight that is significant
SHAPED_SIGMAS = 200.0  # departure up to which it is fitted; its shape is then known to a per cent
# largest fitted departure at a touch, as a share of the depth; beyond it a stiff contact may already rebound
SHAPED_DEPTH = 3e-5
FURTHER = 10.0  # factor on that departure up to which a force with a quadratic term is fitted, for better precision
DESCRIBED = 3.0  # standard deviations of chi^2 up to which that force describes the departure
DEEP = 3e-3  # departure, over the depth, that no floor motion reaches
# time to that departure over a massless plate's: shortest possible; above which something else came first
SHORTENED, SLOWER = 0.7, 1.1
LONGEST_REACH_S = 1.0e-3  # flight before the edge to which the line is fitted from which the displacement departs
SLOW_RECORD_SAMPLES = 64  # the same in samples, for a record at a few hundred Hz
CURVED_DEGREE = 2  # degree of the line through the last millisecond of flight if the floor's motion curves it
PLAINER = 1.1  # log of three: log prior odds of the model with one parameter fewer
PLAIN = 9.0  # gain in chi^2 required of a curved line
TRIALS = 64  # trial instants, on a coarse grid and again on a fine one
LIKELY = 25.0  # of chi^2 above its minimum: the range of the fine grid
FLIGHT_TRIALS = 28  # trial instants per side, for both edges of a short flight jointly


@dataclass(frozen=True, slots=True)
class Edge:
    """A contact's first or last instant in s, with its standard uncertainty."""

    time_s: float
    std_s: float

    def with_added_uncertainty(self, std_s: float) -> "Edge":
        """Return the edge with a further, independent standard uncertainty."""
        return Edge(self.time_s, float(np.hypot(self.std_s, std_s)))


def edge_of_flight(
    motion: Motion, flight: tuple[int, int], coarse: int, *, until: int, depth_m: float, guard_s: float
) -> Edge | None:
    """Return the contact's edge at the end of a flight (first, last sample), near sample ``coarse``.

    The line is fitted to the last millisecond of flight only, up to ``guard_s`` before ``coarse``, so that floor motion
    curves it little.  A force ``a + b u`` at the time ``u`` beyond the edge causes a departure of
    ``(a/2) u^2 + (b/6) u^3`` (times 1/m).  The edge is the least-squares instant over the samples up to a departure of
    SHAPED_SIGMAS, or SHAPED_DEPTH of the whole ``depth_m``, and not beyond ``until``.  The force grows away from the
    edge (b >= 0), and a contact begins with a push (a >= 0; a release may end in tension): otherwise a flight could be
    fitted as a contact without force.  The plate yields: a touch is fitted up to a departure FURTHER with a third term,
    ``-(c/24) u^4`` (c >= 0), if that describes it.  Without this term the instant would be late by half its uncertainty
    on a quiet floor.  None without a clear departure.
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
    line_degree = _line_degree(u[straight], x[straight] - x[0])
    departure = x - x[0] - np.polyval(np.polyfit(u[straight], x[straight] - x[0], line_degree), u)
    rest = departure[straight]
    std = float(np.sqrt(rest @ rest / (rest.size - line_degree - 1)))
    std = max(std, float(np.nanmedian(motion.displacement_std_m)), MIN_NOISE_M)
    omega = abs(float(np.polyfit(u[straight], x[straight] - x[0], 1)[0])) / max(depth_m, 1e-12)  # of a half-sine
    most = SHAPED_SIGMAS * std
    if into:
        most = max(2.0 * CLEAR_SIGMAS * std, min(most, SHAPED_DEPTH * depth_m))
    found = None
    if into:
        further = (std, FURTHER * most, omega)
        found = _edge_with_error(motion, window, departure, further, sign, line_degree, quadratic_force=True)
    found = found or _edge_with_error(motion, window, departure, (std, most, omega), sign, line_degree)
    if found is None:
        return None
    edge, apart = found
    late_s = 0.0
    if into:
        late_s = _later(u - (edge.time_s - float(motion.time_s[coarse])), departure, std, depth_m, omega)
    return Edge(edge.time_s, float(np.linalg.norm((edge.std_s, apart, late_s))))


def _later(u_s: Floats, departure_m: Floats, std_m: float, depth_m: float, omega: float) -> float:
    """Return the delay in s of a contact after ``u_s`` = 0 if its departure grows too slowly for a contact; else 0.

    The departure grows slowest for a massless plate: a half-sine of depth ``depth_m`` reaches (omega u)^3 / 6 of it.
    Plate mass only shortens the time to a departure, to SHORTENED at a twentieth of the block's mass.  If the departure
    took longer, something else curved the flight first, such as a knock on the table.
    """
    deep_m = max(DEEP * depth_m, CLEAR_SIGMAS * std_m)
    deep = first_run(np.abs(departure_m) > deep_m, 3)
    if deep is None or deep == 0 or omega <= 0.0 or depth_m <= 0.0:
        return 0.0
    took_s, longest_s = float(u_s[deep - 1]), float(np.cbrt(6.0 * deep_m / depth_m)) / omega
    return took_s - SHORTENED * longest_s if took_s > SLOWER * longest_s else 0.0


_FEWEST = 8  # fewest samples of a short flight
_FORCE_NUMBERS = 8  # parameters fitted jointly with its line: two edges, a force of three terms on either side


def _line_degree(u_s: Floats, x_m: Floats) -> int:
    """Return the degree of the line through a stretch of flight: 2 if floor motion clearly curves it, else 1."""
    straight, bent = (float(np.sum((x_m - np.polyval(np.polyfit(u_s, x_m, k), u_s)) ** 2)) for k in (1, CURVED_DEGREE))
    return CURVED_DEGREE if straight - bent > PLAIN * bent / (u_s.size - CURVED_DEGREE - 1) else 1


def edge_of_line(motion: Motion, line: Flight, *, until: int, bend: int) -> Edge | None:
    """Return the edge of a contact that departs from a flight's own line, on the side of sample ``until``.

    If ``bend`` is positive, a polynomial of that degree is fitted jointly with the edge; the uncertainty then includes
    the shifts by a shorter departure and by one degree more.
    """
    sign = 1 if until > line.last else -1
    until = min(max(until, 0), motion.time_s.size - 1)
    window = np.arange(line.first if sign > 0 else line.last, until + sign, sign)
    window = window[motion.valid[window] & np.isfinite(motion.displacement_m[window])]
    departure = motion.displacement_m[window] - line.position_m(motion.time_s[window])
    std = max(line.noise_std_m, MIN_NOISE_M)
    most = SHAPED_SIGMAS * std
    further = FURTHER * most if sign > 0 else most  # before a release the force passes its peak within that range
    found = _edge_with_error(motion, window, departure, (std, further, 0.0), sign, bend, quadratic_force=True)
    found = found or _edge_with_error(motion, window, departure, (std, most, 0.0), sign, bend)
    return None if found is None else found[0].with_added_uncertainty(found[1])


def _edge_with_error(
    motion: Motion,
    window: Ints,
    departure_m: Floats,
    levels: tuple[float, float, float],
    sign: int,
    line_degree: int,
    *,
    quadratic_force: bool = False,
) -> tuple[Edge, float] | None:
    """Return the edge and, in s, its systematic error from the assumed shapes of force and flight.

    The error is the edge's shift by one more degree of the line or, without a quadratic term, by a shorter departure;
    0 for a known line.  The arguments are those of ``_edge_in``.
    """
    edge = _edge_in(motion, window, departure_m, levels, sign, line_degree, quadratic_force=quadratic_force)
    if edge is None or line_degree == 0:
        return None if edge is None else (edge, 0.0)
    std_m, shaped_m, omega = levels
    others = [_edge_in(motion, window, departure_m, levels, sign, line_degree + 1, quadratic_force=quadratic_force)]
    if not quadratic_force:
        others.append(_edge_in(motion, window, departure_m, (std_m, shaped_m / 3.0, omega), sign, line_degree))
    return edge, max((abs(edge.time_s - other.time_s) for other in others if other is not None), default=0.0)


def _edge_in(
    motion: Motion,
    window: Ints,
    departure_m: Floats,
    levels: tuple[float, float, float],
    sign: int,
    line_degree: int,
    *,
    quadratic_force: bool = False,
) -> Edge | None:
    """Return the edge shown by a departure (n,) from flight, in the direction ``sign`` of time.

    ``levels`` are the noise and the largest fitted departure, in m, and the angular frequency of the contact's spring.
    ``line_degree`` is that of the line fitted jointly with the edge, 0 for a known line.  A ``quadratic_force`` has a
    third term, which reduces the force at a touch and increases it into the contact at a release, as tension fades.
    None if this force does not describe the departure.
    """
    std_m, shaped_m, omega = levels
    step = 1.0 / motion.sample_rate_hz
    clear = first_run(np.abs(departure_m) > CLEAR_SIGMAS * std_m, 3)
    if clear is None:
        return None
    shaped = first_run(np.abs(departure_m) > shaped_m, 3) or departure_m.size - 1
    shaped = min(max(shaped, clear + 6), departure_m.size - 1)
    # a cubic departure began this long before it became significant
    growth = np.cbrt(max(abs(float(departure_m[shaped])), shaped_m) / (CLEAR_SIGMAS * std_m))
    earlier = max(1.0, 1.0 / max(growth - 1.0, 0.1)) if line_degree else 1.0
    reach = 1.5 * (shaped - clear) * earlier + 3
    start = max(0, int(clear - 2.0 * reach - 24)) if line_degree == 0 else 0
    latest = max(0.5, shaped - clear - 4.0) if line_degree else 0.5  # the significant departure may be floor motion
    anchor = float(motion.time_s[window[clear]])
    beyond = sign * (motion.time_s[window[start : shaped + 1]] - anchor)
    found = _least_squares_edge(
        beyond,
        departure_m[start : shaped + 1],
        std_m,
        (-reach * step, latest * step),
        (max(line_degree, 1), omega, -sign * quadratic_force),
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
    """Return the likeliest edge ``within_s`` (first, last), with its departure (n,) at the times ``u_s`` (n,).

    ``shape`` is the degree of the line fitted jointly, the angular frequency of the contact's spring, and the sign of
    the quadratic force term (0: none).  With ``tension`` the step of force may be negative.  None if the samples are
    too few, the likeliest instant is the first one, or the quadratic force does not describe the departure.
    """
    line_degree, omega, quadratic = shape
    terms = 2 + abs(quadratic)
    if u_s.size < line_degree + 2 + terms or not np.any(u_s):
        return None
    trials = np.linspace(*within_s, TRIALS)
    # building vibration curves the flight relative to the known line, so the line before the edge is fitted as well
    line, _ = np.linalg.qr(np.vander(u_s / np.abs(u_s).max(), line_degree + 1))
    scaled = departure_m / std_m
    scaled = scaled - line @ (line.T @ scaled)
    found: Edge | None = None
    for narrowing in range(2):
        flat = _force_terms(u_s[:, None] - trials, omega, quadratic).reshape(u_s.size, -1)
        flat -= line @ (line.T @ flat)
        costs = np.empty((trials.size, 2))
        _costs_of_one(_grams_of_each(flat, terms), flat.T @ scaled, float(scaled @ scaled), tension, costs)
        freedom = max(u_s.size - line_degree - 2 - terms, 1)
        least = max(1.0, float(costs.min()) / freedom)
        cost = _average_of_models(costs[:, 0], costs[:, 1], least, PLAINER)  # with a step of force and without
        best = int(cost.argmin())
        if best == 0 and narrowing == 0:
            return None
        beyond = int(np.count_nonzero(u_s > trials[best]))
        if quadratic and costs.min() > freedom + DESCRIBED * np.sqrt(2.0 * beyond):
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
    """Return release and onset of a short flight between two contacts, fitted jointly with its line.

    The line is a polynomial of degree ``bend``: 1, or 2 if the floor curves the flight.

    ``time_s`` and ``displacement_m`` (n,) span the flight and a little of the contact on either side; ``release`` and
    ``onset`` are the search ranges in s.  None if an edge lies at the outer end of its range.  The forces are those of
    ``edge_of_flight``; models with and without third terms are averaged by likelihood.  Cost: 2 FLIGHT_TRIALS^2 small
    least-squares solutions on each of two grids, 5 ms in total.
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
        before, after = ranges[0] - tau[:, None], tau[:, None] - ranges[1]
        terms = [_force_terms(before, quadratic=1), _force_terms(after, quadratic=-1)]
        flat = np.concatenate([side.reshape(tau.size, -1) for side in terms], axis=1)
        flat -= line @ (line.T @ flat)
        costs = np.empty((2, FLIGHT_TRIALS, FLIGHT_TRIALS))
        for without, each in enumerate(costs):
            _costs_of_two(flat.T @ flat, flat.T @ scaled, float(scaled @ scaled), 3 - without, each)
        least = max(1.0, float(costs.min()) / max(tau.size - fitted, 1))
        cost = _average_of_models(costs[0], costs[1], least, 2.0 * PLAINER)
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


def _average_of_models(full: Floats, plain: Floats, least: float, plainer: float) -> Floats:
    """Return -2 ln L of two models averaged; the one with fewer parameters has log prior odds ``plainer``.

    ``full`` and ``plain`` are their sums of squared residuals at every trial; ``least`` is the variance in their unit.
    """
    return np.asarray(-2.0 * least * np.logaddexp(-0.5 * full / least, plainer - 0.5 * plain / least))


def _force_terms(u_s: Floats, omega: float = 0.0, quadratic: int = 0) -> Floats:
    """Return the departures by a step and by a slope of force at u = 0, scaled to about 1: (n, k) gives (n, k, 2 or 3).

    If ``quadratic`` is 1 or -1, the third is that of a force growing or falling quadratically in time.  With ``omega``
    the first two are those of a spring: 2 (1 - cos) and 6 (x - sin x), to fourth order.
    """
    since = np.maximum(u_s, 0.0)
    u = since / np.maximum(since.max(axis=0), 1e-300)
    out = np.empty((*u.shape, 2 + abs(quadratic)))
    out[..., 0] = u * u
    out[..., 1] = out[..., 0] * u
    if quadratic:
        out[..., 2] = quadratic * out[..., 1] * u
    if omega:
        square = (omega * since) ** 2
        out[..., 0] *= 1.0 - square / 12.0 + square**2 / 360.0
        out[..., 1] *= 1.0 - square / 20.0 + square**2 / 840.0
    return out


def _grams_of_each(flat: Floats, terms: int) -> Floats:
    """Return each trial's Gram matrix of its terms, (trials, terms, terms), from columns (n, terms trials)."""
    of_trial = flat.reshape(flat.shape[0], -1, terms).transpose(1, 2, 0)
    return of_trial @ of_trial.transpose(0, 2, 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _costs_of_one(gram: Floats, across: Floats, whole: float, tension: bool, cost: Floats) -> None:
    """Write the residual sum of squares at every trial with all force terms, and without the step, (trials, 2).

    ``gram`` (trials, k, k) and ``across`` (k trials,) hold a trial's k terms.  About 0.2 us per trial with two terms.
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
    """Write the residual sum of squares for every pair of a release and an onset, with 2 or 3 force terms each.

    Columns of releases precede those of onsets, three per force.  About 2 us per pair with two terms, 6 us with three.
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
def _explained(gram: Floats, across: Floats, index: Ints, free: Mask) -> float:  # noqa: C901 (kernel)
    """Return the largest sum of squares explained by columns ``index``, with coefficients >= 0 unless ``free``.

    If the best coefficients of a subset are not allowed, one of the negative ones is zero at the allowed optimum.  The
    search therefore starts from all columns and removes one at a time.  About 0.1 us per subset of three.
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
    """Return mean and standard deviation of the instant, with trials weighted by their likelihood exp(-chi2/2).

    If two instants explain the record almost equally, the uncertainty covers both.
    """
    weight = np.exp(-0.5 * (cost - cost.min()) / spread**2)
    weight /= weight.sum()
    mean = float(weight @ trials)
    step = float(trials[1] - trials[0])
    return Edge(mean, float(np.sqrt(weight @ (trials - mean) ** 2 + step**2 / 12.0)))
