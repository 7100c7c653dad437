"""A ripple finer than the averaged samples is asked at the record's rate; the frame's sway follows the parameters."""

from dataclasses import dataclass, replace
from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import named
from analysis.diagnosis.search import full_rate
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.search.full_rate import at_full_rate
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.samples import FINE_RATE_HZ, RATE_HZ
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

RIPPLE = "cyclic_error"


def test_a_ripple_too_weak_for_averaged_samples_is_seen_at_the_records_rate() -> None:
    motions = shots({RIPPLE: {"amplitude_m": 1.5e-10, "order": 2.0}})
    before = base_fit(motions)
    found = at_full_rate(before, Trail(before, list(KINDS.values()), calm), motions)
    assert found is not None
    best, _ = found
    assert best.effects == (named(RIPPLE),)
    assert best.problem.data.shots[0].spacing_s == pytest.approx(1 / FINE_RATE_HZ)
    assert before.problem.data.shots[0].spacing_s == pytest.approx(1 / RATE_HZ)
    clean = shots({})
    alone = base_fit(clean)
    assert at_full_rate(alone, Trail(alone, list(KINDS.values()), calm), clean) is None


@dataclass(frozen=True)
class _Data:
    site: object
    base: object = None
    shots: tuple[object, ...] = ()


def test_without_a_found_effect_the_sway_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate that seems to have moved far then tells of an effect that is missing, and must not absorb it."""
    monkeypatch.setattr(full_rate, "on_frame_anew", lambda *_: pytest.fail("nothing is fitted anew"))
    start: Any = Some()
    trail: Any = Some(start=start, stop=calm)
    assert full_rate.with_sway_updated(start, trail) == (start, trail)


def test_what_remains_to_be_fitted_at_the_records_rate_ends_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search that is begun after that computes where it begins, and no more."""
    motions = shots({RIPPLE: {"amplitude_m": 1e-9, "order": 2.0}}, count=2)
    best = base_fit(motions)
    before = replace(best, z=best.z + 30.0 * np.sqrt(np.diag(best.inverse)))  # with a way to go
    asked: list[bool] = []
    computed: list[int] = []
    refit, search, square = full_rate.refit, Problem.search, Problem.square

    def fitted(*arguments: Any) -> Any:
        found = refit(*arguments)
        asked.append(True)
        return found

    def begun(*arguments: Any, **options: Any) -> Any:
        computed.append(0)
        return search(*arguments, **options)

    def counted(*arguments: Any) -> Any:
        computed[-1] += 1
        return square(*arguments)

    monkeypatch.setattr(full_rate, "refit", fitted)
    monkeypatch.setattr(Problem, "search", begun)
    monkeypatch.setattr(Problem, "square", counted)
    at_full_rate(before, Trail(before, [KINDS[RIPPLE]], lambda: bool(asked)), motions)
    refitted, *after = computed
    assert refitted > 1 and len(after) >= 2 and set(after) == {1}
