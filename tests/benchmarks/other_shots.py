"""What other kinds of shots than planned ones could tell: ``python -m tests.benchmarks.other_shots [--page FILE]``.

For pairs of effects that sets leave open: how far the rival stays off now, after the best planned shot, and after a
record at rest, a flight without the plate, a shot on a plate of its own, and the same shots sampled five times as fast.
To first order, every shot's own parameters eliminated, the first of a pair true at a residual SNR of 13.
"""

import argparse
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects import effect_named, effects_named
from analysis.collision.effects.row import Acts, SensorInput
from analysis.collision.parameters import Infeasible
from analysis.inference.fit.problem import Fitted
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.planning.model_comparison import ComparedModel, ModelComparison, compare_models, refit_diagnosed, rivals
from analysis.planning.next_shot import NextShot, Reach, next_shots
from analysis.planning.predictions import (
    Information,
    blank_shot,
    information_of,
    information_without,
    predict,
    present_information,
)
from tests.bench.blind import records
from tests.benchmarks.loop_cases import Case, as_motion, draw

Floats = NDArray[np.float64]
PAIRS = (
    ("coulomb_friction", "sensor_drift"),
    ("tilt", "sensor_drift"),
    ("bearing_gradient", "frame_vibration"),
    ("cubic_stiffness", "contact_exponent"),
    ("nonlinear_contact_damping", "plate_motion"),
    ("demodulation_lag", "block_mode"),
    ("viscoelastic_arm", "plate_damping"),
    ("plate_damping", "viscoelastic_arm"),
    ("second_plate_mode", "support_compliance"),
    ("support_compliance", "second_plate_mode"),
)
_REST_S, _FLIGHT_M_PER_S = 0.2, 0.2
_PLATE = ("plate_stiffness_n_per_m", "plate_mass_kg")
_STEP = 1e-4  # of a search coordinate, for the derivative of what a sensor adds


@dataclass(frozen=True, slots=True)
class Row:
    """One pair: the distance of the rival in noise norms, now and after one more record of each kind."""

    true: str
    rival: str
    now: float
    finer: float
    planned: float
    at_rest: float
    free_flight: float
    own_plate: float


def row(true: str, rival: str, seed: int) -> Row | None:
    """Return one pair's distances, None where the rival has no motion there."""
    truth = draw(Case("single", (true,), 13.0, "white", seed), bounded=False).truth
    motions = [as_motion(record) for record in records(truth)]
    given = fit_shots(motions, effects=(true,))
    open_class = compare_models(given, effects_named((true, rival)), motions)
    fine = refit_diagnosed(given, motions, _calm, (effect_named("cyclic_error"),))
    finely = rivals(fine, effect_named(true), [effect_named(rival)], _calm)
    if open_class is None or not finely:
        return None
    a, b = (next(m for m in open_class.members if m.effect.name == name) for name in (true, rival))
    shots = a.fitted.problem.data.shots
    known, floor = present_information(b.fitted, open_class.floor), open_class.floor
    unshared = _of_the_plate(b.fitted)
    every = [blank_shot(shot, a.fitted) for shot in next_shots(shots, Reach())]
    flight = blank_shot(NextShot(_FLIGHT_M_PER_S, 0.0, 0.25, 0.01), a.fitted)
    flight = replace(flight, valid=flight.centre_s < 0.249)

    def after(shot: Samples, own: list[int] | None = None) -> float:
        try:
            found = information_of(b.fitted, predict(a.fitted, shot), floor)
            return _distance(known + (_without(found, own) if own else found), a)
        except Infeasible:
            return 0.0

    fine_chi2 = sum(float(left @ left) for left in fine.whitened(fine.noise))
    return Row(
        true,
        rival,
        _distance(known, a),
        sqrt(max(0.0, finely[0].chi2 - fine_chi2)),
        max(after(shot) for shot in every),
        _distance(known + _at_rest(open_class, a, b, floor), a),
        after(flight),
        max(after(shot, unshared) for shot in every),
    )


def _distance(said: Information, true: ComparedModel) -> float:
    return sqrt(max(0.0, said.least - true.chi2))


def _without(said: Information, places: list[int]) -> Information:
    """Return a shot's information with the parameters at these places eliminated, as they are that shot's own."""
    known = np.column_stack([said.curvature, said.gradient])
    across = np.linalg.solve(said.curvature[np.ix_(places, places)], known[places])
    left = known - said.curvature[:, places] @ across
    left[places], left[:, places] = 0.0, 0.0  # they are zero up to rounding
    chi2 = said.chi2 - float(said.gradient[places] @ across[:, -1])
    return Information(left[:, :-1], left[:, -1], chi2, said.penalty)


def _of_the_plate(fitted: Fitted) -> list[int]:
    """Return the places of what another plate would have for itself: its base parameters and its effects'."""
    out = []
    for place, column in enumerate(fitted.problem.shared):
        name = fitted.problem.names[column][0]
        effect = name.partition(".")[0] if "." in name else ""
        if name in _PLATE or (effect and effect_named(effect).acts is Acts.ON_PLATE):
            out.append(place)
    return out


def _at_rest(open_class: ModelComparison, true: ComparedModel, rival: ComparedModel, floor: Floor) -> Information:
    """Return what a record of a block at rest says: only a sensor moves there, and the optics' offset is its own."""
    like = blank_shot(NextShot(0.1, 0.0, _REST_S / 2, _REST_S / 2), true.fitted)
    shown, _, _ = _sensed(true.fitted, like)
    made, columns, own = _sensed(rival.fitted, like)
    shared = rival.fitted.problem.shared
    jacobian = np.zeros((like.centre_s.size, rival.fitted.problem.size + 1))
    jacobian[:, : columns.shape[1]] = columns
    jacobian[:, -1] = 1.0
    jacobian = np.column_stack([jacobian, own])
    rows = like.whitened(floor, np.column_stack([made - shown, jacobian]))
    return information_without(rows[:, 1:], rows[:, 0], len(shared))


def _sensed(fitted: Fitted, like: Samples) -> tuple[Floats, Floats, Floats]:
    """Return what sensors add to a block at rest, its derivatives by the vector, and by each shot's own phase."""
    problem, time_s = fitted.problem, like.centre_s

    def seen(z: Floats, turn: float = 0.0) -> Floats:
        values, out = problem.unpack(z).values[0], np.zeros((time_s.size, 1))
        for kind in problem.effects:
            effect = kind.effect
            if effect.at_rest and effect.sensor is not None:
                of = {**values[effect]}
                if "phase_rad" in of:
                    of["phase_rad"] += turn
                p = np.array([[of[one.name]] for one in effect.parameters])
                out = effect.sensor(SensorInput(time_s, np.zeros_like(time_s), 6.33e-7, 1 / like.spacing_s), out, p)
        return np.asarray(out[:, 0])

    here = seen(fitted.z)
    columns = np.zeros((time_s.size, problem.size))
    for place in problem.shared[problem.data.count :]:
        there = fitted.z.copy()
        there[place] += _STEP
        columns[:, place] = (seen(there) - here) / _STEP
    return here, columns, ((seen(fitted.z, _STEP) - here) / _STEP)[:, None]


def page(rows: list[Row]) -> str:
    """Return the table as Markdown."""
    head = "| true | rival | now | sampled finer | best planned shot | at rest | free flight | own plate |"
    out = [head, "|---|---|---|---|---|---|---|---|"]
    for one in rows:
        numbers = (one.now, one.finer, one.planned, one.at_rest, one.free_flight, one.own_plate)
        out.append(f"| {one.true} | {one.rival} | {' | '.join(f'{n:.1f}' for n in numbers)} |")
    return "\n".join(out) + "\n"


def _calm() -> bool:
    return False


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--page", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    rows = []
    for true, rival in PAIRS:
        one = row(true, rival, options.seed)
        print(one or f"{true}: {rival} has no motion there", flush=True)
        rows += [one] if one else []
    print(page(rows))
    if options.page:
        options.page.write_text(page(rows), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
