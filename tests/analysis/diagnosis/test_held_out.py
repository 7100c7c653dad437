"""A held-out shot takes no part in what it is foretold with: spoilt, it leaves the trained parameters as they are."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.diagnosis.evidence.cross_validation import Prediction, predict
from analysis.inference.fit.problem import Fitted, Problem
from tests.analysis.diagnosis.shots import base_fit, calm, shots

Floats = NDArray[np.float64]
HELD = 1


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return base_fit(shots({}))


def spoilt(fitted: Fitted, which: int) -> Fitted:
    """Return a fit of the same parameters, one of whose shots shows 100 nm that were not there."""
    data = fitted.problem.data
    wave = 1e-7 * np.sin(np.arange(data.shots[which].displacement_m.size) / 9.0)
    one = replace(data.shots[which], displacement_m=data.shots[which].displacement_m + wave)
    every = tuple(one if i == which else shot for i, shot in enumerate(data.shots))
    return replace(fitted, problem=replace(fitted.problem, data=replace(data, shots=every)))


def trained(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> tuple[Floats, Prediction]:
    """Return the parameters that foretell the held-out shot, and what they foretell."""
    seen, search = [], Problem.search

    def watched(*given, **named):  # type: ignore[no-untyped-def]
        seen.append(search(*given, **named))
        return seen[-1]

    with monkeypatch.context() as patch:
        patch.setattr(Problem, "search", watched)
        told = predict(fitted, (HELD,), fitted.noise, calm)
    assert told is not None and len(seen) == 1
    return seen[0].parameters, told


def test_a_spoilt_shot_that_is_held_out_changes_no_trained_parameter(
    fitted: Fitted, monkeypatch: pytest.MonkeyPatch
) -> None:
    clean, told = trained(fitted, monkeypatch)
    held, held_told = trained(spoilt(fitted, HELD), monkeypatch)
    assert clean.tobytes() == held.tobytes()
    assert held_told.minus_2_ln_likelihood > told.minus_2_ln_likelihood + 1e3 and held_told.rms_m > 5e-8 > told.rms_m
    kept, _ = trained(spoilt(fitted, 0), monkeypatch)
    assert clean.tobytes() != kept.tobytes(), "one that does take part does change them"
