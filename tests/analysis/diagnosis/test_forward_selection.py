"""The search for several effects takes more than one way."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.search import forward_selection
from analysis.diagnosis.search.forward_selection import (
    Trail,
    add_effects,
    converge,
    nearly_as_likely,
    restart_from_other_effects,
)
from analysis.inference.fit.added_effect import refit, with_both_effects
from analysis.inference.fit.problem import Fitted, Floats, Problem
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots
from tests.analysis.diagnosis.test_acceptance import Fit


def test_two_effects_that_look_like_a_third_are_found_by_another_way() -> None:
    true = {"bearing_gradient", "plate_damping"}
    motions = shots(
        {"bearing_gradient": {"stiffness_n_per_m": 1.3e-4}, "plate_damping": {"coefficient_n_s_per_m": 1.9e-6}}
    )
    before = base_fit(motions)
    catalogue = [KINDS[name] for name in (*true, "viscous_drag", "frame_vibration")]
    trail = Trail(before, catalogue, calm)
    greedy = add_effects(before, trail, 2)
    assert effect_named("viscous_drag") in greedy.effects
    best = restart_from_other_effects(greedy, trail)
    assert {effect.name for effect in best.effects} == true and best.bic < greedy.bic - 100


def test_a_mode_is_found_beside_a_ripple_from_where_it_was_found_alone() -> None:
    ripple, mode = "cyclic_error", "second_plate_mode"
    effects = {
        ripple: {"amplitude_m": 1.08e-9, "order": 2.0},
        mode: {"mass_kg": 0.0138, "frequency_hz": 3555.0, "damping_ratio": 0.0025},
    }
    start = base_fit(shots(effects))

    def one_more(before: Fitted, name: str) -> Fitted:
        at = before.linearise()
        found = refit(at, KINDS[name], at.scores(KINDS[name])[0].start, calm)
        assert found is not None
        return found

    first = one_more(start, ripple)
    both = with_both_effects(first, one_more(start, mode), start, calm)
    assert both is not None and both.effects == (effect_named(ripple), effect_named(mode))
    assert both.bic < one_more(first, mode).bic - 500  # which goes nowhere from there
    assert both.point.values[0][effect_named(mode)]["mass_kg"] == pytest.approx(0.0138, rel=0.05)


def test_a_fit_far_behind_another_is_not_followed_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    at = base_fit(shots({"coulomb_friction": {"force_n": 2e-6}})).linearise()
    start = at.scores(KINDS["adhesion"])[0].start
    solved: list[int] = []
    derivatives = Problem.derivatives

    def counted(problem: Problem, z: Floats) -> Sequence[tuple[Floats, Floats]]:
        solved.append(1)
        return derivatives(problem, z)

    monkeypatch.setattr(Problem, "derivatives", counted)

    def fitted(least_bic: float) -> tuple[Fitted, int]:
        solved.clear()
        found = refit(at, KINDS["adhesion"], start, calm, least_bic=least_bic)
        assert found is not None
        return found, len(solved)

    best = refit(at, KINDS["coulomb_friction"], at.scores(KINDS["coulomb_friction"])[0].start, calm)
    assert best is not None
    (to_its_end, every), (left, few) = fitted(math.inf), fitted(best.bic)
    near, as_many = fitted(to_its_end.bic - 50)
    assert few < every and left.bic > best.bic + 300 and left.bic == pytest.approx(to_its_end.bic, abs=5)
    assert as_many == every and np.array_equal(near.z, to_its_end.z)  # where it may matter, nothing is changed


def test_two_that_nearly_undo_each_other_are_found_though_neither_pays_alone() -> None:
    effects = {"contact_exponent": {"delta": 1.7e-5}, "coulomb_friction": {"force_n": 1.05e-8}}
    before = base_fit(shots(effects, seed=5))
    trail = Trail(before, [KINDS[name] for name in (*effects, "cubic_stiffness")], calm)
    greedy = add_effects(before, trail)
    assert greedy is before
    assert {effect.name for effect in restart_from_other_effects(greedy, trail).effects} == set(effects)


@pytest.mark.parametrize(
    ("gain", "converged", "taken"),
    [(-0.3, True, True), (-0.7, True, False), (-0.3, False, False), (0.3, False, True)],
)
def test_a_search_that_is_cut_off_must_not_have_lost_likelihood(gain: float, converged: bool, taken: bool) -> None:
    """Two ends of one valley differ by up to half a unit of ln L; a search without an end may not lose any."""

    def ended(log_likelihood: float, **more: Any) -> Any:
        noise = SimpleNamespace(coloured=False)
        return SimpleNamespace(
            effects=(), bic=-2.0 * log_likelihood, log_likelihood=log_likelihood, noise=noise, **more
        )

    further = ended(100.0 + gain, converged=converged)
    before = ended(100.0, converged=False, refitted=lambda **_: further)
    assert converge(before, Trail(before, (), calm)) is (further if taken else before)


def test_the_first_effect_alone_is_also_fitted_from_white_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """The noise of the start holds what the first effect explains, and may keep the search in a wrong valley."""
    tilt, drag, adhesion = (effect_named(name) for name in ("tilt", "viscous_drag", "adhesion"))
    fits = [Fit(effects, worth=500.0) for effects in ((), (tilt,), (tilt, drag), (tilt, drag, adhesion))]
    anew: list[tuple[int, bool]] = []

    def extended(here: Fit, _trail: Trail, *, first: bool, width: int) -> Any:
        assert first is (not here.effects)
        return fits[len(here.effects) + 1]

    def polished(fitted: Fit, _trail: Trail, *, from_white: bool = False) -> Any:
        anew.append((len(fitted.effects), from_white))
        return fitted

    for name, instead in (
        ("add_best_effect", extended), ("converge", polished), ("prune", lambda best, _trail: best),
        ("wider_fits", lambda *_: []),
    ):  # fmt: skip
        monkeypatch.setattr(forward_selection, name, instead)
    start: Any = fits[0]
    assert forward_selection.add_effects(start, Trail(start, (), calm), 3) is fits[3]
    assert anew == [(1, True), (2, False), (3, False)]


@pytest.mark.parametrize(("gains", "found"), [(2.1, 1), (1.9, 2)])
def test_what_cannot_come_below_a_likelier_search_is_not_followed(gains: float, found: int) -> None:
    """A second effect is taken to gain as much as the first at most, so that both reach two of its gains."""
    true = {"coulomb_friction": {"force_n": 2e-6}, "cubic_stiffness": {"coefficient_n_per_m3": 2e4}}
    start = base_fit(shots(true))
    catalogue = [KINDS[name] for name in true]
    one = add_effects(start, Trail(start, catalogue, calm), 1)
    beat = start.bic - gains * (start.bic - one.bic)
    best = add_effects(start, Trail(start, catalogue, calm, beat=beat), 2)
    assert len(best.effects) == found


@pytest.mark.parametrize(
    ("other", "behind", "ends_behind", "taken"),
    [
        ("plate_damping", 200.0, -10.0, True),
        ("plate_damping", 200.0, 10.0, False),  # brought to its end it is not likelier
        ("plate_damping", 600.0, -10.0, False),  # so far behind it is not tried
        ("support_compliance", 200.0, -10.0, False),  # no look-alike with fewer parameters
    ],
)
def test_a_simpler_look_alike_of_the_first_effect_is_brought_to_its_end_beside_it(
    monkeypatch: pytest.MonkeyPatch, other: str, behind: float, ends_behind: float, taken: bool
) -> None:
    def fitted(bic: float, *names: str) -> Any:
        return SimpleNamespace(effects=tuple(effect_named(name) for name in names), bic=bic)

    start, arm, simpler = fitted(0.0), fitted(-1800.0, "viscoelastic_arm"), fitted(behind - 1800.0, other)
    trail = Trail(start, (), calm)
    for one in (arm, simpler):
        trail.keep(one)

    def polished(one: Any, _trail: Trail, *, from_white: bool = False) -> Any:
        assert from_white
        return SimpleNamespace(effects=one.effects, bic=-2000.0 + (ends_behind if one is simpler else 0.0))

    monkeypatch.setattr(forward_selection, "converge", polished)
    (name,) = forward_selection._polished_first(arm, trail).effects
    assert name == effect_named(other if taken else "viscoelastic_arm")


def test_effects_nearly_as_likely_as_the_first_are_followed_beside_it() -> None:
    def fitted(bic: float, *names: str) -> Any:
        return SimpleNamespace(effects=tuple(effect_named(name) for name in names), bic=bic)

    start, first = fitted(0.0), fitted(-100.0, "tilt")
    near, far, alike = fitted(-81.0, "viscous_drag"), fitted(-79.0, "adhesion"), fitted(-99.0, "sensor_drift")
    trail = Trail(start, (), calm)
    for one in (first, near, far, alike, fitted(-99.0, "viscous_drag", "adhesion")):
        trail.keep(one)
    assert nearly_as_likely(first, trail) == [first, near]
    assert nearly_as_likely(start, trail) == [start]
