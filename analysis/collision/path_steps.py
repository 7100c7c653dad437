"""Lays the steps of a path between samples and events, none longer than its mode allows."""

import math

import numpy as np

from analysis.collision import general
from analysis.collision.modes import FREE, PHASE
from analysis.collision.parameters import Floats
from analysis.collision.system import Integers
from analysis.compiled import kernel


def cut_at_events(
    events: general.Recorded, time_s: Floats, each: tuple[int, int]
) -> tuple[Floats, Floats, Integers, Integers]:
    """Return (begin, end, sample at the end or -1, event at which the mode began or -1) of steps, mode by mode.

    ``each``: steps per sample in contact and apart.
    """
    most = (time_s.size + events.time_s.size) * (max(each) + 1)
    begin, end = np.empty(most), np.empty(most)
    sample, event = np.full(most, -1), np.empty(most, dtype=np.int64)
    spacing = float(time_s[1] - time_s[0])
    whole = np.where(events.modes[:, PHASE] == FREE, spacing / each[1], spacing / each[0])
    count = _lay_steps(np.ascontiguousarray(time_s), events.time_s, whole, begin, end, sample, event)
    return begin[:count], end[:count], sample[:count], event[:count]


@kernel
def _lay_steps(time_s, starts, whole, begin, end, sample, event):  # type: ignore[no-untyped-def]
    """Write the steps of ``cut_at_events``, no longer than ``whole`` of their mode, and return their number."""
    first, r, at = 0, 0, starts[0]
    while first < time_s.size and time_s[first] < starts[0] - 1e-13:
        first += 1
    for i in range(first - 1, -1, -1):
        begin[r], end[r], sample[r], event[r] = at, time_s[i], i, -1
        at = time_s[i]
        r += 1
    i = first
    while i < time_s.size and time_s[i] <= starts[0] + 1e-13:
        i += 1
    for mode in range(starts.size):
        at, last = starts[mode], mode == starts.size - 1
        done = last and i >= time_s.size
        while not done:
            if last or (i < time_s.size and time_s[i] < starts[mode + 1] - 1e-13):
                knot, met = time_s[i], i
            else:
                knot = starts[mode + 1]
                met = i if i < time_s.size and time_s[i] <= knot + 1e-13 else -1
            pieces = max(1, math.ceil((knot - at) / whole[mode] - 1e-6))
            for piece in range(pieces):
                begin[r] = at + (knot - at) * piece / pieces
                end[r] = at + (knot - at) * (piece + 1) / pieces if piece < pieces - 1 else knot
                event[r] = mode
                r += 1
            if met >= 0:
                sample[r - 1] = met
                i += 1
            at = knot
            done = i >= time_s.size if last else knot == starts[mode + 1]
    return r


@kernel
def lay_instants(begin, end, halves, early, instants, place):  # type: ignore[no-untyped-def]
    """Write the times, two for each of ``halves`` per step, in order, and the index at which each step begins.

    All are on the grid of the shortest steps, on which the solver is fastest; the ``early`` ones in reverse order.
    """
    at = 0
    for k in range(begin.size):
        step = early - 1 - k if k < early else k
        low, high = begin[step], end[step]
        if k < early:
            low, high = high, low
        count = 2 * halves[step]
        for j in range(count):
            instants[at + j] = low + (high - low) * j / count
        place[step] = at + count if k < early else at
        at += count
        instants[at] = high
