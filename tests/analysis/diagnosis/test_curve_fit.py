"""Curves fitted with derivatives that serve for many steps end where those taken anew at every step lead."""

import math
import threading

import numpy as np
import pytest

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning import curve_fit
from analysis.diagnosis.learning.curve_motion import Ground, ground_of
from analysis.inference.fit.base import base_named
from analysis.inference.fit.first_fit import base_fit, first_fit
from analysis.inference.fit.joint_data import JointData
from analysis.inference.fit.samples import averaged_shots
from tests.law_rigs import LawRig

PLACE = next(a for a in ARGUMENTS if a.name == "place")


def calm() -> bool:
    """Never ask to stop."""
    return False


@pytest.fixture(scope="module")
def ground() -> Ground:
    """Return what a magnet is learned on: it moves the block by some micrometres."""
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-3 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    motions = rig.shots()
    data = JointData(averaged_shots(motions), base_named("paper"))
    return ground_of(base_fit(data, first_fit(motions, "paper", None, calm), calm))


def test_old_derivatives_lead_to_the_same_curve(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> None:
    start = curve_fit.screen(ground, PLACE, 12, calm, steps=3)
    counted = []
    honest = curve_fit.motions
    monkeypatch.setattr(curve_fit, "motions", lambda *given: counted.append(1) or honest(*given))  # type: ignore[func-returns-value]

    def fitted(faithful: float) -> tuple[curve_fit.Learned, int]:
        monkeypatch.setattr(curve_fit, "_FAITHFUL", faithful)
        counted.clear()
        return curve_fit.fit_terms(start.problem, start.z, start.terms, calm, steps=6), len(counted)

    (kept, few), (anew, many) = fitted(curve_fit._FAITHFUL), fitted(math.inf)
    assert few < many
    both = [np.concatenate([one.z, one.terms[0].coefficients]) for one in (kept, anew)]
    far = both[0] - both[1]
    curvature = anew.curvature.copy()
    curvature[anew.z.size :, anew.z.size :] += anew.penalty
    assert far @ curvature @ far < 0.5  # of chi^2: no number is further off than its standard deviation
    assert kept.bic == pytest.approx(anew.bic, abs=1.0)


def test_a_law_that_is_nothing_yet_leaves_the_shots_as_they_are(ground: Ground) -> None:
    term = curve_fit.Term(PLACE, basis := curve_fit.graded_basis(*ground.visited(PLACE), 12), np.zeros(basis.count))
    laid = ground.beside(term)
    solved = curve_fit.motions(ground.fitted.problem, ground.fitted.z, (term,))
    for shown, other in zip(laid.displacement_m, solved.displacement_m, strict=True):
        assert np.abs(shown - other).max() < 1e-13
    for one, other in zip(laid.derivatives, solved.derivatives, strict=True):
        assert np.abs(one - other).max() < 2e-4 * np.abs(other).max()


def test_threads_that_come_first_share_the_members_of_a_basis() -> None:
    met, seen = threading.Barrier(4), []

    def look(basis: Basis) -> None:
        met.wait()
        seen.append(basis.members)

    for _ in range(20):
        basis = curve_fit.graded_basis(-1.0, 1.0, 12)
        threads = [threading.Thread(target=look, args=(basis,)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all(members is basis.members for members in seen[-4:])
