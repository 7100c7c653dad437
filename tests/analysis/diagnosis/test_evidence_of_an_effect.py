"""What the evidence for an effect is worth: how far the criterion would rise without it."""

from dataclasses import dataclass
from typing import Any, cast

import pytest

from analysis.collision.effects.row import Effect
from analysis.diagnosis import explanation, laws_outside_catalogue
from analysis.diagnosis.evidence.identifiability import Separation
from analysis.diagnosis.evidence.residual import Residual
from analysis.diagnosis.findings.result import FoundEffect
from analysis.diagnosis.search.forward_selection import Trail
from analysis.inference.noise.floor import Floor
from tests.analysis.diagnosis.shots import calm
from tests.analysis.diagnosis.test_acceptance import TILT
from tests.analysis.diagnosis.test_acceptance import Fit as Bare


@dataclass(frozen=True)
class Fit(Bare):
    """A fit with a chi^2."""

    def chi2(self, _floor: Floor) -> float:
        """Return a chi^2 that falls by its worth with each effect."""
        return 1e4 + self.bic


WITH, LESS = Fit((TILT,)), Fit(())


def evidence(fewer: Fit | None, monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Return the evidence for an effect beside a fit without it."""
    monkeypatch.setattr(explanation, "without", lambda *_: fewer)
    monkeypatch.setattr(explanation, "indistinguishable_effects", lambda *_: ((), None))
    beside = Separation(500.0, {}, {})
    trail = Trail(cast(Any, LESS), (), calm)
    found = explanation._found(cast(Any, WITH), TILT, {}, Residual(0.0, 57.0, 0.03, 1.1), beside, trail)
    return dict(found.evidence)


def test_the_evidence_is_what_is_lost_without_the_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    told = evidence(LESS, monkeypatch)
    assert told["delta_bic"] == -200.0
    assert told["snr"] == pytest.approx(200.0**0.5)


def test_where_there_is_no_fit_without_the_effect_nothing_is_said_of_what_it_would_lose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A change of 0 would say that the model does as well without it."""
    told = evidence(None, monkeypatch)
    assert "delta_bic" not in told
    assert told["snr"] == 500.0


@pytest.mark.parametrize("known", [{}, {"delta_bic": -70.0}])
@pytest.mark.parametrize("fewer", [None, LESS])
def test_beside_a_law_the_evidence_is_that_of_the_fit_with_the_law(
    known: dict[str, float], fewer: Fit | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(laws_outside_catalogue, "snr", lambda *_: 500.0)
    effect: Effect = TILT
    before = FoundEffect(effect, {}, {"snr": 3.0, "least_separation": 9.0, **known})
    anything = cast(Any, None)
    told = laws_outside_catalogue._anew(before, {}, cast(Any, WITH), anything, cast(Any, fewer)).evidence
    assert told["least_separation"] == 9.0
    assert told["snr"] == pytest.approx(500.0 if fewer is None else 200.0**0.5)
    assert told.get("delta_bic") == (-200.0 if fewer is not None else known.get("delta_bic"))
