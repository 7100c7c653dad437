"""The model with effects: solved at any times, with derivatives by any of its parameters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision import march
from analysis.collision.modes import CONTACT, FREE, NEAR_0, OVERLAPPED, PARTING
from analysis.collision.parameters import Collision, Floats
from analysis.collision.slots import Active as Active
from analysis.collision.slots import Swings, lay_out, swings
from analysis.collision.slots import direction as direction
from analysis.collision.system import MAX_EVENTS, Record, System

_BASE_STEP = 0.14  # radians of the fastest swing of block, contact and plate a step: 1e-12 of the displacement
_HIDDEN_STEP = 0.22  # of an effect's own swing, which is small beside the motion
_LONGEST_S = 1e-3
_RIGHT_M, _ORDER = 1e-18, 12  # what a step longer than safe may be off by, and how it goes with the stride


@dataclass(frozen=True, slots=True)
class Event:
    """The mode changes: ``kind`` "touch", "release", "damping_off", "damping_on", "turn", ...; time from first touch.

    ``state`` is (x_b, v_b, x_p, v_p, hidden states).  The derivatives are total ones, by the k directions asked for: of
    the event's time, shape (k,), and of the state at that event, shape (k, 4 or more).
    """

    kind: str
    time_s: float
    state: Floats
    time_derivatives: Floats
    state_derivatives: Floats


class TooManyEvents(ArithmeticError):
    """The contact chatters, or swings so fast that it would be followed for minutes: no trajectory is given."""


@dataclass(frozen=True, slots=True)
class GeneralRun:
    """A collision with mechanical effects at the asked times, arrays of shape (n,); time zero is the first touch.

    ``displacement_derivatives`` has shape (n, k), by the ``directions`` asked for.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    plate_displacement_m: Floats
    plate_velocity_m_per_s: Floats
    contact_point_m: Floats
    displacement_derivatives: Floats
    happened: "Happened"

    @property
    def events(self) -> tuple[Event, ...]:
        """Get the changes of mode, in order."""
        return self.happened.events

    @property
    def gap_m(self) -> Floats:
        """Get the gap between block and contact point; negative: they overlap."""
        return self.displacement_m - self.contact_point_m

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is in contact at the end."""
        return self.happened.released


@dataclass(frozen=True, slots=True)
class Happened:
    """The events of a march as its kernel leaves them: copied only where somebody asks, as most trajectories' are not.

    ``numbers`` is how many of a state are told.
    """

    kinds: tuple[str, ...]
    record: Record
    numbers: int

    @property
    def events(self) -> tuple[Event, ...]:
        """Get all of them, in order."""
        return tuple(map(self._event, range(len(self.kinds))))

    def _event(self, place: int) -> Event:
        record, numbers = self.record, self.numbers
        return Event(
            self.kinds[place],
            float(record.event_time[place]),
            record.event_state[place, :numbers].copy(),
            record.event_d_time[place].copy(),
            record.event_d_state[place, :, :numbers].copy(),
        )

    @property
    def released(self) -> Event | None:
        """Get the last release, or None while the block is in contact at the end."""
        for place in range(len(self.kinds) - 1, -1, -1):
            if self.kinds[place] in ("touch", "release"):
                return self._event(place) if self.kinds[place] == "release" else None
        return None


class RunsAway(ArithmeticError):
    """The parameters make the motion grow without bound."""


def solve(
    collision: Collision,
    effects: Sequence[Active],
    time_s: Floats,
    *,
    directions: Sequence[int] = (),
    stride: float = 1.0,
    block: int = 1,
    rates: Swings | None = None,
) -> GeneralRun:
    """Solve ``collision`` with mechanical ``effects`` at ``time_s``, shape (n,), ascending.

    ``directions`` are indices into ``parameters.kernel_order`` (0 to 6) and ``direction(slot, place)``, a slot being a
    place in ``effects``; the block's mass (7) is not among them.  Before the touch only what acts on the block and
    has no hidden state takes part: what rides inside has come to rest.  ``block``: everything but the events is a mean
    over so many samples, the last ones left out where they do not fill one.  ``rates`` are what ``swings`` says of
    them, where that is known.

    Effects that are linear in the state are solved to rounding.  Where one is not, ``stride`` lengthens the steps: 2
    takes 0.6 of the time and shows the displacement of a millimetre to 0.05 pm instead of 0.001 pm.  A kink is stepped
    over, by no more than a stride of 1: a hinge of 5 N/m is right to 3 pm so (of 2: to 130 pm), one of 50 to 30 pm.
    Raises TooManyEvents, RunsAway, ValueError.
    """
    asked = _Asked(time_s, tuple(directions), block)
    record, count, system = _solved(collision, effects, asked, stride, rates or swings(collision, effects))
    left = block // record.block
    states, d_x = averaged(record.states, left), averaged(record.d_x, left)
    kinds = tuple(map(_kind, record.event_kind[:count].tolist()))
    x, v, y, u, point = states[:, :5].T
    return GeneralRun(averaged(record.times, block), x, v, y, u, point, d_x, Happened(kinds, record, system.numbers))


@dataclass(frozen=True, slots=True)
class Recorded:
    """A motion as the kernels leave it: of e events the time, kind and mode after them, and states at the asked times.

    ``modes`` has shape (e, flags); ``states``, shape (n, 4 + hidden), hold the effects' hidden states too.
    """

    time_s: Floats
    kinds: NDArray[np.int64]
    modes: Floats
    states: Floats


def recorded(collision: Collision, effects: Sequence[Active], time_s: Floats, spacing_s: float = 0.0) -> Recorded:
    """Solve as ``solve`` does, and return whole states and modes; ``spacing_s``: how far apart most times are."""
    asked = _Asked(time_s, whole=True, spacing_s=spacing_s)
    record, count, system = _solved(collision, effects, asked, 1.0, swings(collision, effects))
    states = np.delete(record.states[:, : 1 + system.numbers], 4, axis=1)  # the contact point is none of them
    return Recorded(record.event_time[:count], record.event_kind[:count], record.event_mode[:count], states)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of a motion: when, by which ``directions``, as means of so many; ``whole``: hidden states too."""

    time_s: Floats
    directions: tuple[int, ...] = ()
    block: int = 1
    whole: bool = False
    spacing_s: float = 0.0  # how far apart most times are, where that is known


def _solved(
    collision: Collision, effects: Sequence[Active], asked: _Asked, stride: float, rates: Swings
) -> tuple[Record, int, System]:
    times = np.ascontiguousarray(asked.time_s, dtype=np.float64)
    if times.ndim != 1 or times.size < asked.block or times.size == 0 or not np.all(times[1:] >= times[:-1]):
        raise ValueError("time_s must be one-dimensional, not empty and ascending")
    system = lay_out(collision, effects, asked.directions)
    shown = 1 + system.numbers if asked.whole else 5
    record = _record(times, asked.block, system, shown)
    closed: Any = march.in_closed_form
    count = march.NOT_LINEAR
    if not any(active.effect.bent for active in effects):
        room = np.zeros(march.room_for(system, record))
        count = closed(system, record, _fastest(rates, asked.spacing_s), room)
    if count == march.NOT_LINEAR:
        record = _record(times, 1, system, shown)
        stepped: Any = march.step_by_step
        room = np.zeros(march.room_for(system, record))
        count = stepped(system, record, _limits(rates, effects, stride), room)
    assert count != march.NO_ROOM
    if count == march.TOO_MANY:
        raise TooManyEvents(f"more than {MAX_EVENTS} contact events with {collision}")
    if count == march.TOO_LONG:
        raise TooManyEvents(f"more steps than a march may take with {collision}")
    if count < 0:
        raise RunsAway(f"the motion grows without bound with {collision}")
    return record, int(count), system


def _record(times: Floats, block: int, system: System, shown: int) -> Record:
    """Return room for what comes of ``times``; the kernels count numbers of a state in fours."""
    k, slots, samples = system.which.size, system.slots.shape[0], times.size // block
    size = 4 * math.ceil(system.numbers / 4)
    return Record(
        times,
        block,
        np.empty((samples, shown)),
        np.empty((samples, k)),
        np.empty(MAX_EVENTS),
        np.empty(MAX_EVENTS, dtype=np.int64),
        np.empty((MAX_EVENTS, size)),
        np.empty((MAX_EVENTS, NEAR_0 + slots)),
        np.empty((MAX_EVENTS, k)),
        np.empty((MAX_EVENTS, k, size)),
    )


def averaged(columns: Floats, block: int) -> Floats:
    """Return ``columns``, shape (n,) or (n, k), as means over blocks of rows; an incomplete one is left out."""
    if block == 1:
        return columns
    count = columns.shape[0] // block
    blocks = columns[: count * block].reshape((count, block, *columns.shape[1:]))
    return np.asarray(np.einsum("nb...->n...", blocks) / block)  # a mean over so short an axis takes four times as long


_KIND = {
    (FREE, CONTACT): "touch",
    (OVERLAPPED, CONTACT): "touch",
    (CONTACT, FREE): "release",
    (CONTACT, OVERLAPPED): "release",
    (PARTING, FREE): "release",
    (CONTACT, PARTING): "damping_off",
    (PARTING, CONTACT): "damping_on",
    (OVERLAPPED, FREE): "apart",
    (9, 0): "turn",
}


def _kind(code: int) -> str:
    return _KIND.get((code // 10, code % 10), "range")


def _fastest(rates: Swings, spacing_s: float) -> Floats:
    """Return the fastest rates in rad/s in contact, apart, gone, and before the touch; then ``spacing_s``."""
    contact, apart = math.hypot(rates.contact, rates.every), math.hypot(rates.plate, rates.every)
    return np.array([contact, apart, rates.inside, 0.0, spacing_s])


def _limits(rates: Swings, effects: Sequence[Active], stride: float) -> Floats:
    """Return the ``limits`` of ``RungeKutta``."""
    if any(active.effect.kinked for active in effects):
        stride = min(stride, 1.0)
    swinging = [math.hypot(rates.contact, rates.every), math.hypot(rates.plate, rates.every), rates.inside, 0.0]

    def longest(base: float, own: float) -> float:
        return min(stride * min(_BASE_STEP / max(base, 1e-9), _HIDDEN_STEP / max(own, 1e-9)), _LONGEST_S)

    safe = [longest(rates.contact, rates.every), longest(rates.plate, rates.every)]
    safe += [longest(0.0, rates.inside), _LONGEST_S]
    # A law that is not smooth where the overlap begins is stepped away from, and up to, in short strides; its slope may
    # be without bound there, and what a step makes of that goes as its length.
    rough = any(active.effect.rough for active in effects)
    growth, nearing, shortest = (1.6, 0.4, 1e-8) if rough else (3.0, 0.0, 1e-4)
    right = _RIGHT_M * stride**_ORDER
    return np.array([*safe, *swinging, longest(0.0, rates.every), growth, nearing, right, shortest])
