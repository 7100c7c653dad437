"""A step towards a curve: smoothed as its restricted likelihood asks, with what is known of it left exact."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import Basis
from analysis.collision.laws.forms import FORMS
from analysis.diagnosis.learning.closed_forms import gauge, information, is_distinct_over, is_outside_base
from analysis.diagnosis.learning.curve_equations import penalised_step
from analysis.diagnosis.learning.curve_fit import Learned, _moved, _penalised
from analysis.diagnosis.learning.curve_motion import Term
from analysis.diagnosis.learning.learned_law import _as
from analysis.inference.model.normal_matrix import NormalMatrix

PLACE = next(one for one in ARGUMENTS if (one.where, one.name) == ("block", "place"))
BASIS = Basis(tuple(np.linspace(0.0, 1.0, 7)))


def rows_of(noise: float, wiggle: float, seed: int = 1) -> tuple[np.ndarray, Term]:
    """Return residual, two base columns and the splines' at 300 places, of a sine plus noise."""
    random = np.random.default_rng(seed)
    at = np.sort(random.uniform(0.0, 1.0, 300))
    fixed = np.stack([np.ones(300), 1e4 * random.standard_normal(300)], axis=1)
    now = random.standard_normal(BASIS.count)
    free = BASIS.design(at)
    truth = fixed @ [2.0, 3e-4] + np.sin(wiggle * at) + noise * random.standard_normal(300)
    return np.column_stack([truth - free @ now, fixed, free]), Term(PLACE, BASIS, now)


@pytest.mark.parametrize(("noise", "wiggle"), [(0.3, 6.0), (0.02, 6.0), (0.3, 0.5)])
def test_the_step_is_the_penalised_solution_at_the_likeliest_smoothing(noise: float, wiggle: float) -> None:
    rows, term = rows_of(noise, wiggle)
    by, penalty, freedom = penalised_step(rows, 2, (term,))
    fixed, free, now = rows[:, 1:3], rows[:, 3:], term.coefficients
    target = rows[:, 0] + free @ now
    basis = np.linalg.qr(fixed)[0]
    free_in, target_in = free - basis @ (basis.T @ free), target - basis @ (basis.T @ target)
    rough = BASIS.roughness
    unit = rough * np.trace(free_in.T @ free_in) / np.trace(rough)
    tiny = 1e-9 * np.diag(np.diag(free_in.T @ free_in))

    def restricted(power: float) -> float:
        """Return the restricted log-likelihood: the curve a Gaussian with this roughness, the base flat."""
        total = free_in.T @ free_in + math.exp(power) * unit + tiny
        solution = np.linalg.solve(total, free_in.T @ target_in)
        square = float(target_in @ target_in - (free_in.T @ target_in) @ solution)
        return -0.5 * (298 * math.log(square) + np.linalg.slogdet(total)[1]) + 0.5 * (BASIS.count - 2) * power

    powers = np.arange(-34.0, 14.0, 1.5)
    best = powers[int(np.argmax([restricted(power) for power in powers]))]
    np.testing.assert_allclose(penalty, math.exp(best) * unit + tiny, rtol=1e-9)
    every = np.column_stack([fixed, free])
    whole = np.pad(penalty, (2, 0))
    scale = np.array([1.0, 1e4, *np.ones(BASIS.count)])
    system = (every.T @ every + whole) / np.outer(scale, scale)
    exact = np.linalg.solve(system, every.T @ target / scale) / scale
    np.testing.assert_allclose(by[:2], exact[:2], rtol=1e-5)
    np.testing.assert_allclose(now + by[2:], exact[2:], rtol=1e-4, atol=1e-4)
    assert freedom == pytest.approx(np.trace(np.linalg.solve(free_in.T @ free_in + penalty, free_in.T @ free_in)))
    assert (freedom < 4.0) is (wiggle < 1.0)
    # rows turned onto fewer stand for as many samples
    turned = np.linalg.qr(rows, mode="r")
    again, same, _ = penalised_step(turned, 2, (term,), samples=300)
    np.testing.assert_allclose(same, penalty, rtol=1e-6)
    np.testing.assert_allclose(again, by, rtol=1e-5, atol=1e-8)


def made() -> Learned:
    random = np.random.default_rng(3)
    small = Basis((0.0, 0.5, 1.0))
    terms = (Term(PLACE, BASIS, np.arange(9.0)), Term(PLACE, small, -np.arange(5.0)))
    root = random.standard_normal((40, 3 + 14))
    shots = [SimpleNamespace(valid=np.arange(200) < 150), SimpleNamespace(valid=np.arange(200) < 50)]
    problem: Any = SimpleNamespace(data=SimpleNamespace(shots=shots))
    pieces = [random.standard_normal((n, n)) for n in (9, 5)]
    penalty = np.zeros((14, 14))
    penalty[:9, :9], penalty[9:, 9:] = (one @ one.T for one in pieces)
    return Learned(problem, terms, np.zeros(3), (), -100.0, NormalMatrix.of(root.T @ root), penalty, 6.5)


def test_a_fit_of_two_curves_and_the_same_with_the_other_last() -> None:
    learned = made()
    assert learned.samples == 200
    assert learned.bic == pytest.approx((3 + 6.5) * math.log(200) + 200.0)
    assert learned.least_form_bic == pytest.approx((3 + 2) * math.log(200) + 200.0)
    swapped = learned.with_last(0)
    assert swapped.terms == learned.terms[::-1]
    for mine in (0, 1):
        # what is known of a curve is the inverse of its part of the whole covariance
        part = slice(3, 12) if mine == 0 else slice(12, 17)
        covariance = np.linalg.inv(learned.curvature.dense())[part, part]
        np.testing.assert_allclose(information(learned.with_last(mine)), np.linalg.inv(covariance), rtol=1e-6)
    np.testing.assert_array_equal(swapped.penalty[:5, :5], learned.penalty[9:, 9:])
    np.testing.assert_array_equal(swapped.penalty[5:, 5:], learned.penalty[:9, :9])
    assert learned.with_last(1).terms == learned.terms
    moved = _moved(learned.terms, np.arange(14.0))
    assert moved[0].coefficients.tolist() == [2.0 * k for k in range(9)]
    assert moved[1].coefficients.tolist() == [9.0] * 5
    left, c = np.array([1.0, 2.0]), np.concatenate([term.coefficients for term in learned.terms])
    assert _penalised(left, learned.terms, learned.penalty) == pytest.approx(5.0 + c @ learned.penalty @ c)
    assert replace(learned, freedom=2.0).least_form_bic == learned.least_form_bic


def test_what_the_base_model_holds_is_taken_off_a_curve_where_it_is_well_known() -> None:
    at = np.linspace(-1.0, 1.0, 41)
    block = gauge(PLACE, at)
    np.testing.assert_array_equal(block, np.stack([at < 0, np.where(at < 0, at, 0.0)], axis=1).astype(float))
    bend = next(one for one in ARGUMENTS if (one.where, one.name) == ("plate", "bend"))
    columns = gauge(bend, at)
    expected = [{"1": np.ones(41), "x": at}[name] for name in bend.gauge]
    np.testing.assert_array_equal(columns, np.stack(expected, axis=1))
    free = next(one for one in ARGUMENTS if not one.gauge and one.name != "place")
    assert gauge(free, at).shape == (41, 0)
    shown = np.cos(3 * at)
    both = np.stack([np.ones(41), 1e6 * at], axis=1)
    std = np.where(at > 0, 0.1, 10.0)
    curve = shown + 5.0 + 2.0 * at + np.where(at > 0, 0.0, 0.01)
    moved = _as(curve, shown, both, std)
    weights = 1.0 / std
    numbers = np.linalg.lstsq(both * weights[:, None] / [1.0, 1e6], (curve - shown) * weights, rcond=None)[0]
    np.testing.assert_allclose(moved, curve - both @ (numbers / [1.0, 1e6]), atol=1e-9)
    assert _as(curve, shown, np.zeros((41, 0)), std) is curve


def test_a_form_is_a_law_of_its_own_or_a_twin_on_one_side() -> None:
    by_name = {form.name: form for form in FORMS}
    contact = next(one for one in ARGUMENTS if one.where == "contact" and not one.factor)
    assert is_outside_base(by_name["constant"], contact) and not is_outside_base(by_name["constant"], PLACE)
    assert is_outside_base(by_name["linear"], PLACE)
    for name in ("quadratic, odd", "power, odd"):
        assert is_distinct_over(by_name[name], -1.0, 1.0) and is_distinct_over(by_name[name], -0.021, 1.0)
        assert not is_distinct_over(by_name[name], -0.019, 1.0) and not is_distinct_over(by_name[name], -1.0, 0.019)
    assert is_distinct_over(by_name["quadratic"], 0.0, 1.0)
    assert not is_distinct_over(by_name["falling exponential"], 0.0, 1.0)
    assert is_distinct_over(by_name["rising exponential"], 0.0, 1.0)
    assert is_distinct_over(by_name["falling exponential"], -1.0, 0.0)
    assert not is_distinct_over(by_name["rising exponential"], -1.0, 0.0)
