"""Fit the base model to shots from their motions alone: the starting point of every further fit and diagnosis.

First guesses come from the fastest shot's contact; the search uses block-averaged samples.  A residual far above the
noise means either a missing effect or a wrong sequence of bounces; a fit of the first bounces alone distinguishes
these.  On a moving frame only fast, small motion is evidence about the bounces.  A first search there assumes a
hundred times the white noise, and a second search the white noise itself.
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference.fit.first_guesses import first_guesses, resembling_candidates
from analysis.inference.fit.problem import Fitted, Problem
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import PLATES_RELIABLE_CHI2, Plates, SearchStart, base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import trials_of
from analysis.inference.model.samples import Samples
from analysis.inference.noise.flights import noise_of_flights
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.site import STILL_FRAME, Site
from analysis.inference.noise.sway import on_site
from analysis.shot import AnalysisError, Cancelled, Floats, Stop

BIASED_CHI2 = 30.0  # chi^2 per sample above which missing effects may have biased base parameters strongly
_EARLY = 0.3  # fraction of the contact time that contains the first bounces
_EVALUATIONS, _ROUGHLY = 60, 30  # limits for a search, and for one that only provides a start for the next
_TOLERANCE = 0.03  # of chi^2
_FOLLOWED = 3  # number of first guesses from which a search starts
_CHI2_TOLERANCE, _PARAMETER_TOLERANCE = 0.01, 0.03  # relative, between searches that end at one minimum
_NOISE_ENLARGEMENT = 100.0  # factor on the white noise in the first of two searches on a moving frame
_FALSE_MINIMUM_CHI2 = 1.0  # chi^2 per sample of that search above which it is in a false minimum or lacks an effect


def first_fit(
    shots: tuple[Samples, ...], model: str, site: Site, stop: Stop, *, noise: Floor | None = None
) -> SearchStart:
    """Return the best fit of the base ``model`` to ``shots``; ``noise`` is that of their flights, if known.

    Raises ValueError for an unknown model, NoCollision (an AnalysisError) if no candidate resembles a contact,
    AnalysisError if no trajectory of the model comes near the shots, Cancelled on request.  Cost: 0.1 s for three
    shots, 0.3 s more on a moving frame.
    """
    base = base_named(model).on_plates(1 + max(shot.plate_number for shot in shots))
    noise = noise or noise_of_flights(shots, site)[0]
    data = JointData(shots, base, site=site)
    ends: list[SearchStart] = []
    why: Infeasible | None = None
    try:
        for end in _ends(data, noise, stop):
            ends.append(end)  # one by one: those before a search without any trajectory count
    except Infeasible as reason:
        why = reason
    if stop():
        raise Cancelled
    if not ends:
        raise AnalysisError(f"no motion of the {model} model comes near these shots: {why}") from why
    return min(ends, key=lambda end: end.left)


def _starts(data: JointData, guesses: Sequence[Floats]) -> list[SearchStart]:
    own = np.array([shot.course.own for shot in data.shots])
    return [SearchStart(data.base, shared, own) for shared in guesses]


def _ends(data: JointData, noise: Floor, stop: Stop) -> Iterator[SearchStart]:
    """Yield the ends of searches on a moving frame until one is sure; if all are poor, also those from a still frame.

    An end is sure if its chi^2 is low, or if another start led to the same minimum.  On a still frame there is one.
    """
    guessed = cache(lambda: _starts(data, first_guesses(data.base, data.shots, stop, data.site.vibration.rms_m)))

    def still_end() -> SearchStart:
        return _best_of_searches(replace(data, site=STILL_FRAME), guessed(), noise, stop)

    if not data.site.moves:
        yield still_end()
        return

    def candidates() -> Iterator[SearchStart]:
        yield from _starts(data, resembling_candidates(data.base, data.shots, _FOLLOWED))
        yield from guessed()[:_FOLLOWED]  # not always needed

    ends: list[SearchStart] = []
    for end in _quiet_search_ends(data, candidates(), noise, stop):
        yield end
        if end.left < PLATES_RELIABLE_CHI2 or any(_same_minimum(end, other) for other in ends):
            return
        ends.append(end)
    if not ends or min(end.left for end in ends) > BIASED_CHI2:
        # a search from a poor guess may end without any collision, especially if an effect is missing
        still = still_end()
        yield still
        yield from _quiet_search_ends(data, iter([still]), noise, stop)


def _quiet_search_ends(
    data: JointData, starts: Iterator[SearchStart], noise: Floor, stop: Stop
) -> Iterator[SearchStart]:
    """Yield the ends of searches with the white noise itself, from those of searches with enlarged noise."""
    for rough in _noisy_search_ends(data, starts, noise, stop):
        with contextlib.suppress(Infeasible):
            yield _search_on_frame(data, rough, noise, stop)


def base_fit(data: JointData, begin: SearchStart, stop: Stop, nuisances: Sequence[Effect] = ()) -> Fitted:
    """Return the base model's best fit at the sample rate of ``data``, searched from ``begin``.

    ``nuisances`` are effects with per-shot parameters that do not count as findings.
    """
    along = trials_of(nuisances)
    values = tuple({kind.effect: kind.starts[0] for kind in along} for _ in data.shots)
    problem = Problem(data, along, data.white_noise)
    z = problem.pack(problem.with_softened_contact(Point(begin.shared, begin.own, values)))
    try:
        return problem.with_start_noise(z).fit(z, anew=True, cancelled=stop)
    except Infeasible as why:
        raise AnalysisError(f"no motion of the base model comes near these shots: {why}") from why


def _best_of_searches(data: JointData, starts: Sequence[SearchStart], noise: Floor, stop: Stop) -> SearchStart:
    """Return the best end of searches from the starts or from a fit of the first bounces alone."""
    floor = replace(noise, site=())
    best = _search_from(data, starts[0], floor, stop)
    if best.left < BIASED_CHI2:
        return best
    further = starts[1:_FOLLOWED]
    early = replace(data, shots=tuple(_first_bounces(shot) for shot in data.shots))
    with contextlib.suppress(Infeasible):
        there = _search_from(early, best, floor, stop, _ROUGHLY)
        if there.left < BIASED_CHI2:
            further = [replace(starts[0], shared=there.shared)]
    for start in further:
        with contextlib.suppress(Infeasible):
            best = min(best, _search_from(data, start, floor, stop), key=lambda end: end.left)
            if best.left < BIASED_CHI2:
                break
    return best


def _same_minimum(end: SearchStart, other: SearchStart) -> bool:
    """Return whether two searches ended at the same minimum; a third guess would then probably end there too."""
    apart = np.abs(end.shared - other.shared) > _PARAMETER_TOLERANCE * np.abs(other.shared)
    return abs(end.left - other.left) < _CHI2_TOLERANCE * other.left and not np.any(apart)


def _first_bounces(shot: Samples) -> Samples:
    until_s = shot.course.touch_time_s + _EARLY * shot.course.contact_time_s
    return replace(shot, valid=shot.valid & (shot.centre_s < until_s))


def _noisy_search_ends(
    data: JointData, starts: Iterator[SearchStart], noise: Floor, stop: Stop
) -> Iterator[SearchStart]:
    """Yield the ends of searches with enlarged white noise: good ends at once, poor ends last, the best of them first.

    Two poor ends at one minimum indicate a missing effect rather than a false minimum, so no further start is tried.
    """
    astray: list[SearchStart] = []
    louder = replace(noise, white_m=_NOISE_ENLARGEMENT * noise.white_m)
    for start in starts:
        with contextlib.suppress(Infeasible):
            rough = _search_on_frame(data, start, louder, stop, _ROUGHLY)
            if rough.left < _FALSE_MINIMUM_CHI2:
                yield rough
                continue
            found_before = any(_same_minimum(rough, other) for other in astray)
            astray.append(rough)
            if found_before:
                break
    yield from sorted(astray, key=lambda rough: rough.left)


def _search_on_frame(
    data: JointData, here: SearchStart, noise: Floor, stop: Stop, evaluations: int = _EVALUATIONS
) -> SearchStart:
    """Return the end of one search, with the frame's response linearised about its start; raises Infeasible."""
    there = replace(data, shots=on_site(data.shots, data.site, data.base, here.point))
    return _search_from(there, here, noise, stop, evaluations)


def _search_from(
    data: JointData, start: SearchStart, floor: Floor, stop: Stop, evaluations: int = _EVALUATIONS
) -> SearchStart:
    """Return the end of one search, with its chi^2 per sample; raises Infeasible if its start has no trajectory."""
    problem = Problem(data, (), floor)
    z = problem.pack(problem.with_softened_contact(start.point))
    found = problem.search(z, evaluations=evaluations, tolerance=_TOLERANCE, cancelled=stop)
    if stop():
        raise Cancelled
    end = problem.unpack(found.parameters)
    left = found.square.chi2 / found.square.samples
    plates = likeliest_plates(problem, found.parameters) if left < PLATES_RELIABLE_CHI2 else ()
    return SearchStart(data.base, end.base, end.own, plates, left)


def likeliest_plates(problem: Problem, z: Floats) -> Plates:
    """Return each plate's likeliest state (m, m/s) at first touch given the residual; empty without frame motion."""
    if not problem.noise.site:
        return ()
    plates = []
    for shot, rest in zip(problem.data.shots, problem.residual_m(z), strict=True):
        assert shot.sway is not None
        plates.append(shot.sway.likeliest_plate(rest, problem.noise))
    return tuple(plates)
