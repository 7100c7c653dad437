"""Curves fitted with derivatives that serve for many steps end where those taken anew at every step lead."""

import itertools
import math
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.diagnosis.learning import curve_fit
from analysis.diagnosis.learning.curve_equations import CurveEquations, penalised_step
from analysis.diagnosis.learning.curve_motion import FitWithMotions, Motions, Term, fit_with_motions
from analysis.inference.fit.first_fit import base_fit, first_fit
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.arrow import Arrow
from analysis.inference.model.base import base_named
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.site import STILL_FRAME
from analysis.shot import Cancelled
from tests.law_rigs import LawRig

PLACE = next(a for a in ARGUMENTS if a.name == "place")


def calm() -> bool:
    """Never ask to stop."""
    return False


@pytest.fixture(scope="module")
def before_law() -> FitWithMotions:
    """Return what a magnet is learned on: it moves the block by some micrometres."""
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-3 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    motions = rig.shots()
    data = JointData(averaged_shots(motions), base_named("paper"))
    return fit_with_motions(base_fit(data, first_fit(averaged_shots(motions), "paper", STILL_FRAME, calm), calm))


def test_old_derivatives_lead_to_the_same_curve(before_law: FitWithMotions, monkeypatch: pytest.MonkeyPatch) -> None:
    start = curve_fit.screen(before_law, PLACE, 12, calm, steps=1)
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
    curvature = anew.curvature.dense()
    curvature[anew.z.size :, anew.z.size :] += anew.penalty
    assert far @ curvature @ far < 0.5  # of chi^2: no number is further off than its standard deviation
    assert kept.bic == pytest.approx(anew.bic, abs=1.0)


def test_a_law_that_is_nothing_yet_leaves_the_shots_as_they_are(before_law: FitWithMotions) -> None:
    term = curve_fit.Term(PLACE, basis := curve_fit.graded_basis(*before_law.visited(PLACE), 12), np.zeros(basis.count))
    laid = before_law.beside(term)
    solved = curve_fit.motions(before_law.fitted.problem, before_law.fitted.z, (term,))
    for shown, other in zip(laid.displacement_m, solved.displacement_m, strict=True):
        assert np.abs(shown - other).max() < 1e-13
    for one, other in zip(laid.derivatives.blocks, solved.derivatives.blocks, strict=True):
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


class Rows:
    """A problem whose displacements are what a test says; the noise is learned as a number that counts its times."""

    def __init__(self, noise: float = 1.0, site: Any = STILL_FRAME) -> None:
        self.noise = noise
        self.low, self.high, self.size = np.full(2, -1e9), np.full(2, 1e9), 2
        self.data: Any = SimpleNamespace(site=site, left_m=lambda shown: tuple(5.0 - one for one in shown))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.low, self.high

    def whitened(self, columns: Any) -> np.ndarray:
        return np.vstack(list(columns)) / self.noise

    def whitened_equations(self, left_m: Any, columns: Arrow) -> tuple[np.ndarray, Arrow]:
        return np.concatenate(list(left_m)) / self.noise, columns.mapped(lambda _, block: block / self.noise)

    def with_noise(self, noise: float) -> "Rows":
        return Rows(noise, self.data.site)

    def learn_noise(self, left: Any, noise: float) -> tuple[float, float]:
        return noise + 1.0, -7.0


TERM = Term(PLACE, Basis((0.0, 0.5, 1.0)), np.zeros(5))


def place_of(value: float, fresh: bool = True) -> Any:
    shown = (np.full(3, value), np.full(2, value))
    derivatives = Arrow.of([np.ones((3, 7)), np.ones((2, 7))], 7)
    return curve_fit._SearchPoint(np.array([value, 0.0]), (TERM,), Motions(shown, derivatives), fresh)


def test_a_step_is_damped_until_it_leads_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undamped first, then ever more; what leads nowhere is no step."""
    tried: list[float] = []
    moves = np.array([1.0, 2.0, *np.arange(5.0)])
    penalty = 0.5 * np.eye(5)
    ends: dict[float, Any] = {}

    def damped(equations: CurveEquations, terms: Any, of: Any, damping: float, free: Any) -> Any:
        assert equations.left.shape == (5,) and terms == (TERM,) and of is penalty
        return None if ends.get(damping) == "none" else moves + damping

    def shown(problem: Any, z: Any, terms: Any) -> Any:
        damping = float(z[0] - 3.0 - 1.0)
        tried.append(damping)
        np.testing.assert_allclose(terms[0].coefficients, moves[2:] + damping)
        np.testing.assert_allclose(z, [4.0 + damping, 2.0 + damping])
        end = next((value for key, value in ends.items() if abs(key - damping) < 1e-12), 1e3)
        if end == "infeasible":
            raise Infeasible("nowhere")
        return np.full(3, end), np.full(2, end)

    monkeypatch.setattr(CurveEquations, "step", lambda equations, terms: (moves, penalty, 2.0))
    monkeypatch.setattr(CurveEquations, "damped_step", damped)
    monkeypatch.setattr(curve_fit, "displacements", shown)
    problem: Any = Rows()
    here = place_of(3.0)
    chi2 = 5 * 2.0**2
    ends |= {0.0: "infeasible", 1e-8: "none", 1e-6: 1e200, 1e-4: 9.0, 1e-2: 5.0}
    went = curve_fit._downhill(problem, here, 0.0)
    assert went.damping == 1e-2 and tried == pytest.approx([0.0, 1e-6, 1e-4, 1e-2])
    bent = moves[2:] + 1e-2
    assert went.actual_fall == pytest.approx(chi2 - 0.5 * bent @ bent)  # nothing is left but the smoothing's price
    by = moves + 1e-2
    assert went.predicted_fall == pytest.approx(chi2 - 5 * (2.0 - by.sum()) ** 2 - 0.5 * bent @ bent)
    assert (
        went.there is not None and not went.there.fresh and went.there.motions.derivatives is here.motions.derivatives
    )
    tried.clear()
    assert curve_fit._downhill(problem, here, 1e-4).damping == 1e-2 and tried == pytest.approx([1e-4, 1e-2])
    ends |= {1e-2: 9.0, 0.3: 1.0}
    none = curve_fit._downhill(problem, here, 1e-4)
    assert none.there is None and (none.damping, none.actual_fall) == (1e-4, 0.0)
    assert none.predicted_fall == pytest.approx(chi2 - 5 * (2.0 - moves.sum()) ** 2 - 0.5 * moves[2:] @ moves[2:])


@pytest.mark.parametrize(("value", "side"), [(3.0, 1.0), (7.0, -1.0)])
def test_a_step_ends_on_a_bound_and_what_presses_against_one_stays(
    value: float, side: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The way down leads up from 3 and down from 7: a number at its bound there is no column of the step."""
    moves, penalty = side * np.array([4.0, 1.0, *np.zeros(5)]), np.zeros((5, 5))
    given: list[CurveEquations] = []
    shown: list[np.ndarray] = []

    def stepped(equations: CurveEquations, terms: Any) -> Any:
        given.append(equations)
        return moves, penalty, 2.0

    def displacements(problem: Any, z: np.ndarray, terms: Any) -> Any:
        shown.append(z)
        return np.full(3, 5.0), np.full(2, 5.0)

    monkeypatch.setattr(CurveEquations, "step", stepped)
    monkeypatch.setattr(curve_fit, "displacements", displacements)
    problem: Any = Rows()
    for bound, end, stays in ((value + 1.5 * side, value + 1.5 * side, False), (value, value, True)):
        given.clear()
        problem.low, problem.high = np.array([min(bound, value), -9.0]), np.array([max(bound, value), 9.0])
        went = curve_fit._downhill(problem, place_of(value), 0.0)
        assert went.there is not None and went.there.z.tolist() == shown[-1].tolist() == [end, side]
        left = np.full(5, 5.0 - value)
        np.testing.assert_allclose(given[0].left, left)
        assert given[0].columns.places[0].tolist() == ([1, 2, 3, 4, 5, 6] if stays else [0, 1, 2, 3, 4, 5, 6])
        rest = left - (end - value) * (not stays) - side
        assert went.predicted_fall == pytest.approx(left @ left - rest @ rest)
    far = np.array([value + 99.0 * side, 9.0 * side])
    behind = np.array([value, -9.0 * side])
    problem.low, problem.high = np.minimum(far, behind), np.maximum(far, behind)
    given.clear()
    curve_fit._downhill(problem, place_of(value), 0.0)
    assert 0 in given[0].columns.places[0]  # a bound behind holds nothing


class Walk:
    """A fit whose steps are given: each by its damping, what chi^2 fell by and what it was to fall by."""

    def __init__(
        self, patch: pytest.MonkeyPatch, *steps: tuple[float, float, float] | None, predicted_fall: float = 0.0
    ) -> None:
        self.asked: list[Any] = []
        self.fresh: list[float] = []
        self.steps, self.lost = iter(steps), predicted_fall

        def downhill(problem: Any, here: Any, damping: float) -> Any:
            self.asked.append((problem.noise, float(here.z[0]), here.fresh, damping))
            step = next(self.steps)
            if step is None:
                return curve_fit._StepResult(None, damping, 0.0, self.lost)
            return curve_fit._StepResult(place_of(here.z[0] + 1.0, fresh=False), *step)

        def anew(problem: Any, z: Any, terms: Any) -> Any:
            self.fresh.append(float(z[0]))
            return place_of(float(z[0])).motions

        patch.setattr(curve_fit, "_downhill", downhill)
        patch.setattr(curve_fit, "motions", anew)
        patch.setattr(CurveEquations, "step", lambda equations, terms: (None, np.eye(5), 2.5))

    def fitted(self, steps: int, *, site: Any = STILL_FRAME, to_the_end: bool = False, stop: Any = calm) -> Any:
        begin = place_of(0.0)
        problem: Any = Rows(site=site)
        return curve_fit._fitted(problem, begin.z, (TERM,), stop, steps, begin.motions, to_the_end=to_the_end)


def test_a_fit_of_curves_takes_its_steps_and_learns_the_noise_from_the_second_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    walk = Walk(monkeypatch, (0.0, 9.0, 10.0), (1e-4, 9.0, 10.0), (1e-2, 9.0, 10.0), (0.0, 9.0, 10.0))
    found = walk.fitted(4)
    assert [one[:3] for one in walk.asked] == [
        (1.0, 0.0, True),
        (1.0, 1.0, False),
        (2.0, 2.0, False),
        (3.0, 3.0, False),
    ]
    assert [one[3] for one in walk.asked] == pytest.approx([0.0, 0.0, 1e-6, 1e-4])
    assert found.z[0] == 4.0 and found.problem.noise == 5.0 and not walk.fresh
    assert found.log_likelihood == -7.0 and found.freedom == 2.5 and found.terms == (TERM,)
    np.testing.assert_allclose(found.curvature.dense(), np.ones((7, 7)) * 5 / 25.0)
    np.testing.assert_allclose(np.concatenate(found.residual_m), 1.0)
    moving = Walk(monkeypatch, *[(0.0, 9.0, 10.0)] * 4)
    # a frame's strengths are learned at the end alone
    assert moving.fitted(4, site=SimpleNamespace(moves=True)).problem.noise == 2.0
    ended = Walk(monkeypatch, (0.0, 9.0, 10.0), (0.0, 9.0, 10.0))
    assert ended.fitted(2, to_the_end=True).z[0] == 2.0 and ended.fresh == [2.0]
    with pytest.raises(Cancelled):
        Walk(monkeypatch).fitted(1, stop=lambda: True)


def test_a_fit_of_curves_ends_where_a_step_brings_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    settled = Walk(monkeypatch, *[(0.0, 0.4, 0.4)] * 9)
    assert settled.fitted(9).z[0] == 3.0  # the third step is the first that may be the last
    damped = Walk(monkeypatch, *[(1e-6, 0.4, 0.4)] * 5)
    assert damped.fitted(5).z[0] == 5.0  # a step held back says nothing
    more = Walk(monkeypatch, *[(1e-8, 0.6, 0.6)] * 5)
    assert more.fitted(5).z[0] == 5.0
    assert [one[3] for one in more.asked] == [0.0] * 5  # the least damping is forgotten
    stuck = Walk(monkeypatch, (0.0, 9.0, 9.0), None)
    assert stuck.fitted(5).z[0] == 1.0 and not stuck.fresh


def test_derivatives_are_taken_anew_where_a_step_brings_less_than_they_promised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for actual_fall, predicted_fall, anew in ((7.9, 10.0, [1.0]), (8.1, 10.0, []), (0.1, 0.49, [])):
        walk = Walk(monkeypatch, (0.0, actual_fall, predicted_fall), (0.0, 9.0, 9.0))
        walk.fitted(2)
        assert walk.fresh == anew
    last = Walk(monkeypatch, (0.0, 1.0, 10.0))
    last.fitted(1)
    assert not last.fresh  # of the last step nothing depends on them
    lost = Walk(monkeypatch, (0.0, 9.0, 9.0), None, (0.0, 9.0, 9.0), predicted_fall=0.6)  # old ones led nowhere
    assert lost.fitted(2).z[0] == 2.0 and lost.fresh == [1.0]
    settled = Walk(monkeypatch, (0.0, 9.0, 9.0), None, predicted_fall=0.4)
    assert settled.fitted(3).z[0] == 1.0 and not settled.fresh


def test_pairs_of_curves_are_told_apart_by_what_both_explain_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against every pair fitted to all samples; an argument that cannot be followed is left out."""
    random = np.random.default_rng(2)
    arguments = [one for one in ARGUMENTS if not one.factor][:4]
    at = {one: random.uniform(0.0, 1.0, 200) for one in arguments}
    fixed = random.standard_normal((200, 2))
    left = fixed @ [1.0, 2.0] + np.sin(5 * at[arguments[0]]) + np.cos(4 * at[arguments[2]])
    left = left + 0.05 * random.standard_normal(200)
    halves = slice(0, 120), slice(120, 200)

    def columns(term: Term) -> Any:
        if term.argument is arguments[3]:
            raise Infeasible("nowhere")
        return [term.basis.design(at[term.argument])[half] for half in halves]

    base = SimpleNamespace(derivatives=Arrow.of([fixed[half] for half in halves], 2))
    rough: Any = Rows(0.1)
    monkeypatch.setattr(curve_fit, "_rough_noise", lambda start: 0.1)
    start = SimpleNamespace(z=np.zeros(2), residual_m=[left[half] for half in halves], problem=Rows())
    before_law: Any = SimpleNamespace(fitted=start, visited=lambda one: (0.0, 1.0), columns=columns, motions=base)
    found = curve_fit.likeliest_pairs(before_law, arguments, 6, calm)
    judged = {}
    for pair in itertools.combinations(arguments[:3], 2):
        terms = tuple(Term(one, curve_fit.graded_basis(0.0, 1.0, 6), np.zeros(9)) for one in pair)
        rows = np.column_stack([left, fixed, *(term.basis.design(at[term.argument]) for term in terms)]) / rough.noise
        by, _, freedom = penalised_step(rows, 2, terms)
        square = float(np.sum((rows[:, 0] - rows[:, 1:] @ by) ** 2))
        judged[pair] = 200 * math.log(square) + freedom * math.log(200)
    assert [(one.argument, two.argument) for one, two in found] == sorted(judged, key=lambda pair: judged[pair])
    assert (found[0][0].argument, found[0][1].argument) == (arguments[0], arguments[2])
    assert all(not term.coefficients.any() and term.basis.count == 9 for pair in found for term in pair)
    assert curve_fit.likeliest_pairs(before_law, [arguments[0], arguments[3]], 6, calm) == []
    with pytest.raises(Cancelled):
        curve_fit.likeliest_pairs(before_law, arguments, 6, lambda: True)


def test_a_finer_curve_begins_as_the_one_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(4)
    first = Term(PLACE, curve_fit.graded_basis(0.2, 1.0, 3), random.standard_normal(6))
    last = Term(PLACE, curve_fit.graded_basis(-1.0, 2.0, 6), random.standard_normal(9))
    monkeypatch.setattr(curve_fit, "fit_terms", lambda *given, **named: (*given, named))
    learned: Any = SimpleNamespace(terms=(first, last), problem="problem", z="z")
    problem, z, (other, finer), stop, named = curve_fit.refine(learned, 12, calm, steps=4)  # type: ignore[misc]
    assert (problem, z, other, stop, named) == ("problem", "z", first, calm, {"steps": 4})
    assert finer.basis == curve_fit.graded_basis(-1.0, 2.0, 12) and finer.argument is PLACE
    at = np.linspace(-1.0, 2.0, 300)
    assert np.abs(finer.curve(at) - last.curve(at)).max() < 0.03 * np.abs(last.curve(at)).max()
    # least squares at places of all knots: no coefficients lie nearer
    near = np.linalg.lstsq(finer.basis.design(at), last.curve(at), rcond=None)[0]
    assert np.abs(near - finer.coefficients).max() < 0.03 * np.abs(near).max()


@pytest.mark.parametrize("moves", [False, True])
def test_curves_are_first_laid_on_what_is_left_as_if_all_of_it_were_white(
    moves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(curve_fit, "white_floor", lambda *given: given)
    valid = np.array([True, True, False])
    shots = [SimpleNamespace(valid=valid), SimpleNamespace(valid=~valid)]
    data = SimpleNamespace(site=SimpleNamespace(moves=moves), shots=shots)
    start: Any = SimpleNamespace(
        problem=SimpleNamespace(data=data), noise=SimpleNamespace(spacing_s=2e-5), unlearned_noise="of flights",
        residual_m=[np.array([3.0, 4.0, 99.0]), np.array([99.0, 99.0, -5.0])],
    )  # fmt: skip
    found: Any = curve_fit._rough_noise(start)
    assert found == ("of flights" if moves else (pytest.approx(math.sqrt(50.0 / 3.0)), 2e-5))
