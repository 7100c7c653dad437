"""How far an effect stands from everything else."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effects_named, named
from analysis.diagnosis.verdict.identifiability import Separation, _nothing, least_seen, missed_without
from analysis.inference.fit.free_parameters import trial_effect

DRAG, TILT, MODE = effects_named(("viscous_drag", "tilt", "block_mode"))


def test_effects_less_than_five_norms_away_are_too_close_nearest_first() -> None:
    far = Separation(30.0, {DRAG: 4.9, TILT: 5.1, MODE: 0.3}, {})
    assert far.too_close() == (MODE, DRAG) and far.too_close(0.15) == (MODE, DRAG, TILT)


def test_what_is_missed_without_an_effect_is_the_root_of_the_growth_of_chi2() -> None:
    def of(chi2: float) -> Any:
        return SimpleNamespace(noise="mine", chi2=lambda noise: {"mine": chi2}[noise])

    assert missed_without(of(100.0), of(149.0)) == 7.0 and missed_without(of(100.0), of(90.0)) == 0.0
    assert missed_without(of(100.0), None) == math.inf


def test_an_effect_does_nothing_without_its_amplitudes() -> None:
    swing = trial_effect(named("plate_motion"))
    assert _nothing(swing, {"velocity_m_per_s": 1.0, "displacement_m": 2.0}) == {
        "velocity_m_per_s": 0.0, "displacement_m": 0.0,
    }  # fmt: skip
    mode = trial_effect(named("block_mode"))
    kept = {"frequency_hz": 500.0, "damping_ratio": 0.1}
    assert _nothing(mode, {"mass_kg": 1e-3, **kept}) == {"mass_kg": 0.0, **kept}
    inverse: Any = SimpleNamespace(inverse=True, amplitude=("stiffness",))
    assert _nothing(inverse, {"stiffness": 3.0, "range_m": 1.0}) == {"stiffness": 1e9, "range_m": 1.0}


@dataclass
class At:
    left: np.ndarray
    listed: list[Any]

    def scores(self, kind: Any) -> list[Any]:
        assert not self.left.any()  # asked of no residual at all
        return self.listed


@pytest.mark.parametrize(("inverse", "least"), [(False, 5.0 * 2e-3 / 4.0), (True, 2e-3 * 4.0 / 5.0)])
def test_the_least_that_would_be_seen_is_where_it_stands_out_by_five_norms(inverse: bool, least: float) -> None:
    kind: Any = SimpleNamespace(inverse=inverse)
    listed = [SimpleNamespace(power=9.0, unit=7.0), SimpleNamespace(power=16.0, unit=2e-3)]
    at: Any = At(np.ones(3), listed)
    assert least_seen(at, kind) == pytest.approx(least)
    nothing: Any = At(np.ones(3), [SimpleNamespace(power=0.0, unit=1.0)])
    never: Any = At(np.ones(3), [])
    assert least_seen(nothing, kind) is None is least_seen(never, kind)
