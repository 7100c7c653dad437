"""Solve the model for one shot: displacement as the sensor shows it, and its derivatives by all parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.collision import (
    Collision,
    Effect,
    EventLog,
    FastestRates,
    Floats,
    Infeasible,
    Parameter,
    Sensed,
    TooManyEvents,
    active_effects,
    chain_matrix,
    chain_rules,
    fastest_rates,
    general,
    sensors,
)
from analysis.inference.fit.base import OWN_NAMES, Base
from analysis.inference.fit.course import Course

DEFAULT_WAVELENGTH_M = 632.8e-9
_MOST_RADIANS = 1e5  # of the contact over the whole record
_STEP = 1e-40  # of a complex step
_PLATE_AT = {  # in ``parameters.kernel_order``
    "plate_motion.displacement_m": 5,
    "plate_motion.velocity_m_per_s": 6,
    "plate_displacement_m": 5,
    "plate_velocity_m_per_s": 6,
}


@dataclass(frozen=True, slots=True)
class ShotData:
    """The samples of one shot that are fitted; arrays of shape (n,)."""

    time_s: Floats
    displacement_m: Floats
    valid: NDArray[np.bool_]
    block_mass_kg: float
    course: Course
    wavelength_m: float = DEFAULT_WAVELENGTH_M
    rate_hz: float = 1e5  # of the demodulated record
    plate: tuple[float, float] = (0.0, 0.0)  # m, m/s: the plate at first touch where that is known and not fitted
    plate_number: int = 0  # on which of the set's plates it was taken
    measured_m: Floats | None = None  # ``displacement_m`` where it is known at every sample, not averaged


@dataclass(frozen=True)
class Model:
    """A base model with effects: its parameters, shared or per shot, and their order.

    ``chosen`` gives the values of parameters that a fit does not move, by "effect.parameter".
    """

    base: Base
    effects: tuple[Effect, ...] = ()
    chosen: tuple[tuple[str, float], ...] = field(default=())

    @cached_property
    def effect_parameters(self) -> tuple[tuple[str, Effect, int, Parameter], ...]:
        """Get (full name, effect, place, parameter) of every effect parameter."""
        return tuple((f"{e.key}.{p.name}", e, place, p) for e in self.effects for place, p in enumerate(e.parameters))

    @cached_property
    def shared_effect_names(self) -> tuple[str, ...]:
        """Get the full names of the shared effect parameters that a fit moves."""
        return tuple(name for name, _, _, p in self.effect_parameters if not p.own and not p.fixed)

    @cached_property
    def shared_names(self) -> tuple[str, ...]:
        """Get the names of all shared parameters in the fit's order."""
        return (*self.base.names, *self.shared_effect_names)

    @cached_property
    def own_names(self) -> tuple[str, ...]:
        """Get the names of a shot's own parameters in the fit's order."""
        return (*self.base.own_names, *(name for name, _, _, p in self.effect_parameters if p.own and not p.fixed))

    def plate_start(
        self, values: Mapping[str, float], own: Floats, known: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """Return the plate's displacement (m) and velocity (m/s) at first touch, from effects, own and known ones."""
        x, v = (values.get(f"plate_motion.{name}", 0.0) for name in ("displacement_m", "velocity_m_per_s"))
        x, v = x + known[0], v + known[1]
        if self.base.swings:
            x, v = x + float(own[len(OWN_NAMES)]), v + float(own[len(OWN_NAMES) + 1])
        return x, v

    def by_effect(self, values: Mapping[str, float]) -> dict[Effect, dict[str, float]]:
        """Return values given by full name as values by effect and parameter."""
        return {e: {p.name: values[f"{e.key}.{p.name}"] for p in e.parameters} for e in self.effects}

    def values(self, shared: Floats, own: Floats) -> dict[str, float]:
        """Return the value of every effect parameter, by full name."""
        given = dict(zip(self.shared_names, shared, strict=True)) | dict(zip(self.own_names, own, strict=True))
        fixed = dict(self.chosen)
        return {
            name: float(given[name]) if name in given else fixed.get(name, p.grid[0] if p.grid else p.scale)
            for name, _, _, p in self.effect_parameters
        }


@dataclass(frozen=True, slots=True)
class Response:
    """The model of one shot at its samples (or averaged over blocks of them), arrays of shape (n,).

    ``displacement_m`` is what the optics would show, offset included; ``derivatives``, shape (n, p), are by (shared,
    own) parameters.  ``velocity_out`` is the block's velocity after its last release with its derivatives by the same.
    """

    displacement_m: Floats
    derivatives: Floats
    velocity_m_per_s: Floats
    plate_displacement_m: Floats
    gap_m: Floats
    log: EventLog
    velocity_out: tuple[float, Floats] | None


def respond(
    model: Model,
    shot: ShotData,
    shared: Floats,
    own: Floats,
    *,
    derivatives: bool = True,
    stride: float = 1.0,
    block: int = 1,
    fastest_rad_per_s: float = math.inf,
) -> Response:
    """Solve the model for one shot; ``own`` begins with (v_i, touch time, offset).

    ``stride`` is that of ``general.solve``; with ``block`` all arrays are averaged over so many samples.  Raises
    Infeasible where there is no such motion, or where something oscillates faster than ``fastest_rad_per_s``.
    """
    values = model.values(shared, own) if model.effects else {}
    start = model.plate_start(values, own, shot.plate)
    collision = model.base.collision(shared, own[0], shot.block_mass_kg, start, shot.plate_number)
    if collision.fastest_rate_rad_per_s * (shot.time_s[-1] - shot.time_s[0]) > _MOST_RADIANS:
        raise Infeasible("the contact would swing faster than any that a record can show")
    given = model.by_effect(values)
    active = active_effects(model.effects, given, collision, float(own[1]))
    chains = chain_rules(model.effects, given, collision, float(own[1])) if derivatives else []
    names = (*model.shared_names, *model.own_names)
    of_base = model.base.columns(shot.plate_number)
    wanted = {name: _direction(of_base, active, name) for name in names} if derivatives else {}
    # A parameter that enters a kernel through others: these get names that no parameter has; the chain rule follows.
    wanted |= {f"{c.slot} {k}": general.direction(c.slot, k) for c in chains for k in range(c.slopes.shape[0])}
    times = shot.time_s - own[1]
    seeing = sensors(model.effects)
    inner = 1 if seeing else block  # the sensor's effects act on every sample, before averaging
    rates = fastest_rates(collision, active)
    if max(rates.contact, rates.every) > fastest_rad_per_s:
        raise Infeasible("something would swing faster than any record can show")
    response = _integrated(collision, active, rates, times, wanted, stride, inner)
    x, columns = response.displacement_m, response.derivatives
    velocity_out = response.velocity_out
    if derivatives:
        columns[:, names.index("touch_time_s")] = -response.velocity_m_per_s
        if chains:
            by_names = chain_matrix(chains, names, of_base)
            columns = columns @ by_names
            velocity_out = None if velocity_out is None else (velocity_out[0], velocity_out[1] @ by_names)
    for effect in seeing:
        x, columns = _through_sensor(effect, shot, values, x, columns, names, response.velocity_m_per_s)
    if derivatives:
        columns[:, names.index("offset_m")] = 1.0
    left = block // inner
    return Response(
        general.averaged(x, left) + own[2],
        general.averaged(columns, left),
        general.averaged(response.velocity_m_per_s, left),
        general.averaged(response.plate_displacement_m, left),
        general.averaged(response.gap_m, left),
        response.log,
        velocity_out,
    )


def _direction(of_base: Mapping[str, int], active: Sequence[general.Active], name: str) -> int | None:
    """Return the integrator's direction for a parameter, or None where it does not act on the motion."""
    if name in of_base:
        return of_base[name]
    if name == "velocity_in_m_per_s":
        return 4
    for slot, one in enumerate(active):
        if one.effect.clocked is not None:
            continue
        for place, parameter in enumerate(one.effect.parameters):
            if name == f"{one.effect.key}.{parameter.name}":
                return general.direction(slot, place)
    return _PLATE_AT.get(name)


def _integrated(
    collision: Collision,
    active: Sequence[general.Active],
    rates: FastestRates,
    times: Floats,
    wanted: dict[str, int | None],
    stride: float,
    block: int,
) -> Response:
    if rates.every * (times[-1] - times[0]) > _MOST_RADIANS:
        raise Infeasible("an effect would swing faster than any that a record can show")
    directions = [at for at in wanted.values() if at is not None]
    try:
        run = general.solve(collision, active, times, directions=directions, stride=stride, block=block, rates=rates)
    except (TooManyEvents, general.UnboundedMotion) as why:
        raise Infeasible(str(why)) from why
    columns = np.zeros((run.time_s.size if wanted else 0, len(wanted)))
    slope = np.zeros(len(wanted))
    released = run.released
    used = 0
    for place, at in enumerate(wanted.values()):
        if at is not None:
            columns[:, place] = run.displacement_derivatives[:, used]
            if released is not None:
                slope[place] = released.state_derivatives[used, 1]
            used += 1
    out = None if released is None else (float(released.state[1]), slope)
    return Response(
        run.displacement_m, columns, run.velocity_m_per_s, run.plate_displacement_m, run.gap_m, run.log, out
    )


def _through_sensor(
    effect: Effect,
    shot: ShotData,
    values: dict[str, float],
    x: Floats,
    columns: Floats,
    names: Sequence[str],
    velocity_m_per_s: Floats,
) -> tuple[Floats, Floats]:
    """Return displacement and derivatives after one effect of the sensor (derivatives by complex steps)."""
    assert effect.sensor is not None
    seen = Sensed(shot.time_s, velocity_m_per_s, shot.wavelength_m, shot.rate_hz, shot.measured_m)
    own = np.zeros((max(3, len(effect.parameters)), 1))
    own[: len(effect.parameters), 0] = [values[f"{effect.name}.{p.name}"] for p in effect.parameters]
    if not columns.shape[1]:
        return np.asarray(effect.sensor(seen, x[:, None], own)[:, 0]), columns
    # An effect without memory multiplies all derivatives at an instant by the same factor.
    moves = columns if effect.remembers else np.ones((x.size, 1))
    count, places = moves.shape[1], list(names)
    full = [f"{effect.name}.{p.name}" for p in effect.parameters]
    moved = [(place, places.index(name)) for place, name in enumerate(full) if name in places]
    steps = np.zeros((x.size, 1 + count + len(moved)), dtype=np.complex128)
    steps[:] = x[:, None]
    steps[:, 1 : 1 + count] += 1j * _STEP * moves
    parameters = np.repeat(own.astype(np.complex128), steps.shape[1], axis=1)
    for k, (place, _) in enumerate(moved):
        parameters[place, 1 + count + k] += 1j * _STEP
    shown = effect.sensor(seen, steps, parameters)
    slopes = shown.imag / _STEP
    out = slopes[:, 1 : 1 + count] * (1.0 if effect.remembers else columns)
    for k, (_, at) in enumerate(moved):
        out[:, at] += slopes[:, 1 + count + k]
    return shown[:, 0].real.copy(), out
