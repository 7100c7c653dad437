"""Members of a comparison: which are likely, how far apart they are, and who pays for values in every shot."""

from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.planning import model_comparison
from analysis.planning.model_comparison import ComparedModel, ModelComparison, _shared_nats, penalty

DRAG, TILT, MODE, MOTION = effects_named(("viscous_drag", "tilt", "block_mode", "plate_motion"))


def member(effect: Any, chi2: float, paid: float = 0.0, nats: float | None = None) -> ComparedModel:
    fitted: Any = SimpleNamespace(nats=nats)
    return ComparedModel(effect, fitted, chi2, paid)


def comparison(*members: ComparedModel, nats: float = inf) -> ModelComparison:
    floor: Any = None
    return ModelComparison(members, floor, nats)


def test_members_are_apart_by_the_root_of_what_their_misfits_differ_by() -> None:
    three = comparison(member(DRAG, 100.0), member(MOTION, 90.0, 26.0), member(MODE, 125.0))
    assert three.separation_from(()) == 4.0 and three.separation_from((MOTION,)) == 5.0
    assert three.separation_from((MOTION, MODE)) == 0.0 == comparison(member(DRAG, 1.0)).separation_from(())
    assert comparison(member(DRAG, 100.0), member(TILT, 99.0)).separation_from(()) == 0.0


@pytest.mark.parametrize(("behind", "likely"), [(8.9, 2), (9.1, 1)])
def test_a_member_three_sigmas_behind_is_not_taken_for_the_true_one(behind: float, likely: int) -> None:
    assert len(comparison(member(DRAG, 50.0, 1.0), member(TILT, 50.0 + behind, 1.0)).likely) == likely


def test_values_in_every_shot_pay_what_they_cost_more_than_shared_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOTION.own and not DRAG.own
    none = SimpleNamespace(nats=None)
    monkeypatch.setattr(
        model_comparison,
        "per_shot_cost",
        lambda fitted, _: None if fitted.nats is None else SimpleNamespace(nats=fitted.nats),
    )
    dear: Any = SimpleNamespace(nats=12.0)
    cheap: Any = none
    assert penalty(MOTION, dear, 4.0) == 16.0 and penalty(MOTION, dear, 13.0) == 0.0
    assert penalty(DRAG, dear, 4.0) == 0.0 == penalty(MOTION, cheap, 4.0)
    own, first, second = member(MOTION, 1.0, nats=9.0), member(DRAG, 20.0, nats=3.0), member(TILT, 10.0, nats=5.0)
    assert _shared_nats([own, first, second]) == 5.0 and _shared_nats([first, own]) == 3.0
    assert _shared_nats([first, second]) == inf == _shared_nats([own]) == _shared_nats([own, member(TILT, 1.0)])
    assert comparison(own, nats=3.0).has_penalty(MOTION) and not comparison(own, nats=3.0).has_penalty(DRAG)
    assert not comparison(own).has_penalty(MOTION)
    assert np.isclose(own.misfit, 1.0)
