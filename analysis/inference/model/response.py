"""The model of one shot: displacement as the sensor shows it, with exact derivatives by all parameters.

In some directions of the base model's parameters the displacement changes ten thousand times less than in others.
Errors of finite differences hide these directions, and a search then stops in the middle of a valley.  The tangents
that the integrator propagates do not have this error.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.collision import (
    KERNEL_ORDER,
    ActiveEffect,
    Acts,
    Collision,
    Effect,
    EventLog,
    FastestRates,
    Floats,
    Infeasible,
    LinearPath,
    SensorInput,
    Trajectory,
    V,
    X,
    active_effects,
    averaged,
    chain_matrix,
    chain_rules,
    direction,
    fastest_rates,
    linear_path,
    sensor_effects,
    solve,
)
from analysis.inference.model.base import OWN_NAMES, Base
from analysis.inference.model.effective_parameters import Values
from analysis.inference.model.samples import Samples
from analysis.shot import DEFAULT_WAVELENGTH_AIR_M

STRIDE = 2.0  # of ``general.solve``: its error for a nonlinear law is then 0.05 pm, far below any noise
_MAX_RADIANS = 1e5  # largest phase of the contact, or of an effect, over the whole record
_MAX_RADIANS_A_SAMPLE = 60.0  # largest phase between two averaged samples that a trajectory follows
_STEP = 1e-40  # size of a complex step


@dataclass(frozen=True)
class ShotModel:
    """The model of one shot with its parameters: the base model's ``shared`` ones, shape (b,), and the shot's own.

    ``own`` are incoming velocity (m/s), touch time (s) and offset (m), shape (3,); ``values`` are those of the effects.
    """

    samples: Samples
    base: Base
    shared: Floats
    own: Floats
    values: Values

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Get the names of the fitted parameters, shared ones first, in the order of the derivatives."""
        moved = [(p.own, f"{effect.key}.{p.name}") for effect in self.values for p in effect.parameters if not p.fixed]
        shared, own = ([name for is_own, name in moved if is_own is wanted] for wanted in (False, True))
        return (*self.base.names, *shared, *OWN_NAMES, *own)

    @cached_property
    def collision(self) -> Collision:
        """Get the collision; raises Infeasible if the parameters are invalid."""
        numbers = [*self.own, *(value for given in self.values.values() for value in given.values())]
        if any(math.isnan(number) for number in numbers):
            raise Infeasible("a parameter is not a number")
        x, v = self.samples.plate
        for effect, given in self.values.items():
            if effect.acts is Acts.AT_START:
                x, v = x + given["displacement_m"], v + given["velocity_m_per_s"]
        mass_kg, plate_number = self.samples.moving_mass_kg, self.samples.plate_number
        return self.base.collision(self.shared, self.own[0], mass_kg, (x, v), plate_number)

    @cached_property
    def active(self) -> list[ActiveEffect]:
        """Get the effects that act on the motion."""
        return active_effects(list(self.values), self.values, self.collision, float(self.own[1]))

    @cached_property
    def rates(self) -> FastestRates:
        """Get the fastest rates of oscillation or decay."""
        return fastest_rates(self.collision, self.active)

    @property
    def too_fast(self) -> bool:
        """Get whether an oscillation is faster than the samples can show, or than a trajectory follows.

        The model itself can have oscillations that no sample shows; a search must avoid these parameters.
        """
        fastest = min(math.pi * self.samples.factor, _MAX_RADIANS_A_SAMPLE) / self.samples.spacing_s
        return max(self.rates.contact, self.rates.effects) > fastest

    def path(self, steps: int, *, for_forces: bool = False) -> LinearPath:
        """Return the linearised trajectory in at least ``steps`` per averaged sample; Infeasible if too many.

        ``for_forces`` as for ``linear_path``.
        """
        hidden_first = sorted(self.active, key=lambda one: one.effect.hidden == 0)
        times = self.samples.centre_s - self.own[1]
        return linear_path(self.collision, hidden_first, times, steps, for_forces=for_forces)

    def with_laws(self, laws: Sequence[Effect]) -> "ShotModel":
        """Return the model with laws that act in addition to the effects, with each law parameter at its scale."""
        return replace(self, values={**self.values, **{law: {p.name: p.scale for p in law.parameters} for law in laws}})


@dataclass(frozen=True, slots=True)
class Response:
    """The model's prediction of one shot at its samples (or averaged over blocks of them), arrays of shape (n,).

    ``displacement_m`` is the displacement shown by the optics, offset included; ``derivatives``, shape (n, p), are by
    the parameters of ``ShotModel.names``.  ``velocity_out`` is the block's velocity after its last release, with its
    derivatives by the same parameters.
    """

    displacement_m: Floats
    derivatives: Floats
    velocity_m_per_s: Floats
    gap_m: Floats
    log: EventLog
    velocity_out: tuple[float, Floats] | None


def respond(
    shot: ShotModel, time_s: Floats, *, derivatives: bool = False, stride: float = STRIDE, block: int = 1
) -> Response:
    """Solve the model of a shot at ``time_s``, shape (n,), on the recording's clock.

    ``stride`` is that of ``solve``; all arrays are averages over ``block`` samples.  Raises Infeasible if there is no
    trajectory.
    """
    chains = chain_rules(list(shot.values), shot.values, shot.collision, float(shot.own[1])) if derivatives else []
    wanted = _directions(shot) if derivatives else {}
    # A parameter may enter a kernel through others: those get placeholder names, and the chain rule follows below.
    wanted |= {f"{c.slot} {k}": direction(c.slot, k) for c in chains for k in range(c.slopes.shape[0])}
    seeing = sensor_effects(shot.values)
    inner = 1 if seeing else block  # the sensor's effects act on every sample, before averaging
    acting = [at for at in wanted.values() if at is not None]
    run = _solved(shot, time_s, acting, stride, inner)
    by_names = chain_matrix(chains, shot.names, shot.base.columns(shot.samples.plate_number)) if chains else None
    x, (columns, slope) = run.displacement_m, _slopes_of_motion(shot, run, wanted, by_names)
    # an average over several samples does not determine the displacement at each of them
    measured_m = shot.samples.displacement_m if shot.samples.factor == 1 else None
    seen = _sensor_input(shot.samples, time_s, run.velocity_m_per_s, measured_m)
    for effect in seeing:
        x, columns = _through_sensor(effect, shot.values[effect], seen, x, columns, shot.names)
    if derivatives:
        columns[:, shot.names.index("offset_m")] = 1.0
    left = block // inner
    return Response(
        averaged(x, left) + shot.own[2],
        averaged(columns, left),
        averaged(run.velocity_m_per_s, left),
        averaged(run.gap_m, left),
        run.log,
        None if run.released is None else (float(run.released.state[1]), slope),
    )


def _slopes_of_motion(
    shot: ShotModel, run: Trajectory, wanted: Mapping[str, int | None], by_names: Floats | None
) -> tuple[Floats, Floats]:
    """Return the derivatives by ``names`` of the displacement, (n, p), and of the velocity after the release, (p,).

    ``wanted`` are the integrator's directions of ``names`` and of placeholders, which the matrix ``by_names`` of the
    chain rule converts to ``names``.  If there are none, p is zero.
    """
    places = [place for place, at in enumerate(wanted.values()) if at is not None]
    columns, slope = np.zeros((run.displacement_m.size, len(wanted))), np.zeros(len(wanted))
    columns[:, places] = run.displacement_derivatives
    if run.released is not None:
        slope[places] = run.released.state_derivatives[:, 1]
    if wanted:
        columns[:, shot.names.index("touch_time_s")] = -run.velocity_m_per_s
    return (columns, slope) if by_names is None else (columns @ by_names, slope @ by_names)


def _directions(shot: ShotModel) -> dict[str, int | None]:
    """Return the integrator's direction of each of ``names``; None if a parameter does not act on the motion."""
    places = {name: place for place, name in enumerate(KERNEL_ORDER)}
    known = {**shot.base.columns(shot.samples.plate_number), "velocity_in_m_per_s": places["velocity_in_m_per_s"]}
    for slot, one in enumerate(shot.active):
        if one.effect.clocked is None:
            known |= {f"{one.effect.key}.{p.name}": direction(slot, k) for k, p in enumerate(one.effect.parameters)}
    for effect in shot.values:
        if effect.acts is Acts.AT_START:
            known |= {f"{effect.key}.{p.name}": places[f"plate_{p.name}"] for p in effect.parameters}
    return {name: known.get(name) for name in shot.names}


def _solved(shot: ShotModel, time_s: Floats, directions: Sequence[int], stride: float, block: int) -> Trajectory:
    collision, length_s = shot.collision, time_s[-1] - time_s[0]
    if shot.rates.bodies * length_s > _MAX_RADIANS:
        raise Infeasible("the contact would swing faster than any that a record can show")
    if shot.rates.effects * length_s > _MAX_RADIANS:
        raise Infeasible("an effect would swing faster than any that a record can show")
    times = time_s - shot.own[1]
    return solve(collision, shot.active, times, directions=directions, stride=stride, block=block, rates=shot.rates)


def change_shown(shot: ShotModel, path: LinearPath, change: Floats) -> Floats:
    """Return small changes, shape (n, k), of the block's position along a shot's ``path`` as the optics show them.

    All times are the centres of the averaged samples.
    """
    seeing = sensor_effects(shot.values)
    if not seeing:
        return change
    x, v = np.empty(len(change)), np.empty(len(change))
    x[:], v[:] = path.effect_inputs[0, 0, X], path.effect_inputs[0, 0, V]
    at = path.sample >= 0
    x[path.sample[at]], v[path.sample[at]] = path.effect_inputs[at, 2, X], path.effect_inputs[at, 2, V]
    seen = _sensor_input(shot.samples, shot.samples.centre_s, v)
    for effect in seeing:
        x, change = _through_sensor(effect, shot.values[effect], seen, x, change, ())
    return change


def _sensor_input(
    samples: Samples, time_s: Floats, velocity_m_per_s: Floats, measured_m: Floats | None = None
) -> SensorInput:
    wavelength_m, rate_hz = samples.wavelength_m or DEFAULT_WAVELENGTH_AIR_M, samples.factor / samples.spacing_s
    return SensorInput(time_s, velocity_m_per_s, wavelength_m, rate_hz, measured_m)


def _through_sensor(
    effect: Effect, given: Mapping[str, float], seen: SensorInput, x: Floats, columns: Floats, names: Sequence[str]
) -> tuple[Floats, Floats]:
    """Return displacement and derivatives after one sensor effect (derivatives by complex steps).

    ``columns``, shape (n, p), are the derivatives before; those by the effect's own parameters in ``names`` are added.
    """
    assert effect.sensor is not None
    own = np.zeros((max(3, len(effect.parameters)), 1))
    own[: len(effect.parameters), 0] = [given[p.name] for p in effect.parameters]
    if not columns.shape[1]:
        return np.asarray(effect.sensor(seen, x[:, None], own)[:, 0]), columns
    # An effect without memory multiplies all derivatives at an instant by the same factor.
    moves = columns if effect.has_memory else np.ones((x.size, 1))
    count = moves.shape[1]
    full = [f"{effect.key}.{p.name}" for p in effect.parameters]
    moved = [(place, names.index(name)) for place, name in enumerate(full) if name in names]
    steps = np.zeros((x.size, 1 + count + len(moved)), dtype=np.complex128)
    steps[:] = x[:, None]
    steps[:, 1 : 1 + count] += 1j * _STEP * moves
    parameters = np.repeat(own.astype(np.complex128), steps.shape[1], axis=1)
    for k, (place, _) in enumerate(moved):
        parameters[place, 1 + count + k] += 1j * _STEP
    shown = effect.sensor(seen, steps, parameters)
    slopes = shown.imag / _STEP
    out = slopes[:, 1 : 1 + count] * (1.0 if effect.has_memory else columns)
    for k, (_, at) in enumerate(moved):
        out[:, at] += slopes[:, 1 + count + k]
    return shown[:, 0].real.copy(), out
