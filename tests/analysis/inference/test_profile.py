"""An attraction's uncertainty follows its bent valley."""

from dataclasses import replace

import numpy as np

from analysis.collision.effects import named
from analysis.inference.fit.effective_parameters import Point
from analysis.inference.fit.profile import with_profile_std
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_an_attraction_is_no_surer_than_the_likelihood_along_its_valley() -> None:
    true = {"force_n": 3.2e-7, "range_m": 3e-5}
    start = base_fit(shots({"adhesion": true}))
    assert with_profile_std(start, calm) is start
    problem = start.problem.with_effects((KINDS["adhesion"],), {})
    z = problem.pack(Point(start.point.base, start.point.own, ({named("adhesion"): true},) * 3))
    best = problem.fit(z, evaluations=60)
    own = slice(problem.offset, problem.size)
    wide = with_profile_std(best, calm)
    assert np.all(wide.std[own] >= best.std[own] * (1 - 1e-12))
    too_sure = replace(best, inverse=best.inverse / 36)
    widened = with_profile_std(too_sure, calm)
    assert np.all(widened.std[own] > 3 * too_sure.std[own])  # the likelihood itself says six tenths of ``best``
    assert np.array_equal(wide.std[: problem.offset], best.std[: problem.offset])
    found = [best.point.values[0][named("adhesion")][name] for name in ("force_n", "range_m")]
    assert np.all(np.abs(np.subtract(found, list(true.values()))) < 3 * wide.std[own])
