"""First guesses of plate and contact from one shot's displacement alone, for the fit to start from."""

from collections.abc import Iterator

import numpy as np

from analysis.model.exact import TooManyEvents, solve
from analysis.model.parameters import Collision, Floats, Variant
from analysis.model.starts import Course

MASS_RATIOS = np.geomspace(0.002, 0.1, 7)
STIFFNESS_RATIOS = np.geomspace(8, 1200, 8)
DAMPING_RATIOS = (0.04, 0.15, 0.4)
_POINTS = 420


def thinned(course: Course, time_s: Floats) -> slice:
    """Return the regular subset of samples, about 420 of them, that spans the contact and a little flight."""
    begin = int(np.searchsorted(time_s, course.touch_time_s - 0.1 * course.contact_time_s))
    end = int(np.searchsorted(time_s, course.touch_time_s + 1.25 * course.contact_time_s))
    return slice(begin, end, max(1, (end - begin) // _POINTS))


def _candidates(block_mass_kg: float, course: Course, variant: Variant, one_body: bool) -> Iterator[Collision]:
    smooth = block_mass_kg * course.rate_rad_per_s**2
    v = course.velocity_in_m_per_s
    for damping in DAMPING_RATIOS:
        if one_body:
            gamma = 2 * damping * np.sqrt(smooth * block_mass_kg)
            yield Collision(block_mass_kg, v, 0.0, np.inf, smooth, gamma, variant=variant)
            continue
        for mass_ratio in MASS_RATIOS:
            plate_mass = mass_ratio * block_mass_kg
            reduced = block_mass_kg * plate_mass / (block_mass_kg + plate_mass)
            for stiffness_ratio in STIFFNESS_RATIOS:
                contact = stiffness_ratio * smooth
                plate = smooth * (1 + mass_ratio) / max(0.3, 1 - 1 / stiffness_ratio)
                gamma = 2 * damping * np.sqrt(contact * reduced)
                yield Collision(block_mass_kg, v, plate, plate_mass, contact, gamma, variant=variant)


def rank(
    course: Course, time_s: Floats, displacement_m: Floats, block_mass_kg: float, variant: Variant, one_body: bool
) -> list[Collision]:
    """Return candidates, best first, by what they leave of the contact once flight and touch time are free.

    Offset, velocity, touch time and the plate's stiffness are projected out linearly, so that the coarse grid has to
    find only the bounces: their mass, stiffness and damping.  About 30 ms for 168 candidates.
    """
    some = thinned(course, time_s)
    t = time_s[some] - course.touch_time_s
    measured = displacement_m[some]
    good = np.isfinite(measured)
    scored: list[tuple[float, Collision]] = []
    for candidate in _candidates(block_mass_kg, course, variant, one_body):
        try:
            run = solve(candidate, t, derivatives=True)
        except TooManyEvents:
            continue
        stiffness = run.displacement_derivatives[:, 2 if one_body else 0]
        columns = np.stack(
            [np.ones(t.size), run.displacement_derivatives[:, 4], run.velocity_m_per_s, stiffness], axis=1
        )[good]
        scale = np.linalg.norm(columns, axis=0)
        if not np.all(np.isfinite(columns)) or not np.all(scale > 0):
            continue
        columns = columns / scale
        left = (measured - run.displacement_m)[good]
        normal = columns.T @ columns
        try:
            solution = np.linalg.solve(normal + 1e-12 * np.eye(normal.shape[0]), columns.T @ left)
        except np.linalg.LinAlgError:
            continue
        rest = left - columns @ solution
        scored.append((float(rest @ rest), candidate))
    scored.sort(key=lambda pair: pair[0])
    return [candidate for _, candidate in scored]
