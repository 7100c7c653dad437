"""How far an effect stands from everything else."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.evidence import identifiability as module
from analysis.diagnosis.evidence.identifiability import Separation, _nothing, least_seen, missed_without
from analysis.inference import Point
from analysis.inference.model.free_parameters import trial_effect

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
    swing = trial_effect(effect_named("plate_motion"))
    assert _nothing(swing, {"velocity_m_per_s": 1.0, "displacement_m": 2.0}) == {
        "velocity_m_per_s": 0.0, "displacement_m": 0.0,
    }  # fmt: skip
    mode = trial_effect(effect_named("block_mode"))
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


class OfTwo:
    """A fit of tilt and a swinging plate: an effect does its amplitude times a column of its own, in every shot."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        random = np.random.default_rng(4)
        self.columns = random.standard_normal((2, 6))
        self.tangents = random.standard_normal((12, 5))
        self.mode = trial_effect(MODE)
        self.tilt = trial_effect(TILT)
        values = ({TILT: {"angle_rad": 2.0}, MODE: {"mass_kg": 3.0, "frequency_hz": 7.0, "damping_ratio": 0.1}},) * 2
        free = [(TILT, None, -1), (MODE, None, -1), (MODE, None, -1), (DRAG, None, -1)]
        self.point = Point("base", "own", values)  # type: ignore[arg-type]
        problem = SimpleNamespace(
            offset=1, free_parameters=free, effects=(self.tilt, self.mode), coarse=self.coarse,
            data=SimpleNamespace(shots=["first", "second"]), whitened=lambda rows: 10.0 * np.vstack(rows),
        )  # fmt: skip
        self.fitted: Any = SimpleNamespace(
            problem=problem, point=self.point, effects=(TILT, MODE),
            effective=Point("effective base", "effective own", values),  # type: ignore[arg-type]
        )  # fmt: skip
        self.at: Any = SimpleNamespace(problem=problem, tangents=SimpleNamespace(without=self.without))
        patch.setattr(module, "to_physical", lambda point: ("actual", point))
        patch.setattr(
            module, "replace", lambda at, *, basis, left: SimpleNamespace(basis=basis, left=left, screen=self.screen)
        )
        self.listed: list[Any] = []

    def coarse(self, shot: int, point: Any) -> np.ndarray:
        if point is self.point:
            return 2.0 * self.columns[0] + 3.0 * (shot + 1) * self.columns[1]
        name, given = point
        assert name == "actual" and (given.base, given.own) == ("effective base", "effective own")
        at = given.values[shot]
        assert at[MODE]["frequency_hz"] == 7.0
        return np.asarray(at[TILT]["angle_rad"] * self.columns[0] + at[MODE]["mass_kg"] * (shot + 1) * self.columns[1])

    def without(self, own: list[int]) -> Any:
        basis = np.linalg.qr(np.delete(self.tangents, own, axis=1))[0]
        return SimpleNamespace(span=lambda: SimpleNamespace(projected=lambda rows: rows - basis @ (basis.T @ rows)))

    def screen(self, others: Any, stop: Any) -> Any:
        self.asked = [kind.effect for kind in others], stop
        return self.listed

    def alone(self, effect: Any) -> np.ndarray:
        """Return the part of an effect that no other parameter can absorb, by least squares."""
        size = 2.0 * self.columns[0] if effect is TILT else 3.0 * self.columns[1]
        done = 10.0 * np.concatenate([size * (1.0 if effect is TILT else shot) for shot in (1, 2)])
        others = np.delete(self.tangents, [1] if effect is TILT else [2, 3], axis=1)
        return np.asarray(done - others @ np.linalg.lstsq(others, done, rcond=None)[0])


@pytest.mark.parametrize("effect", [TILT, MODE])
def test_the_size_of_an_effect_is_what_no_other_parameter_absorbs(effect: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    of = OfTwo(monkeypatch)
    np.testing.assert_allclose(module.isolated_effect(of.fitted, of.at, effect).left, of.alone(effect), atol=1e-9)
    assert module.snr(of.fitted, of.at, effect) == pytest.approx(np.linalg.norm(of.alone(effect)))


def test_every_other_effect_of_the_catalogue_has_its_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    """The root of what is left of the effect beside it; of one that has no score all of it is."""
    of = OfTwo(monkeypatch)
    drag, friction, drift = (
        trial_effect(effect_named(name)) for name in ("viscous_drag", "coulomb_friction", "sensor_drift")
    )
    whole = float(of.alone(TILT) @ of.alone(TILT))
    of.listed = [
        [SimpleNamespace(kind=drag, gain=g * whole, start=start) for g, start in ((0.75, "best"), (0.1, "worse"))],
        [SimpleNamespace(kind=friction, gain=1.01 * whole, start="all")],
    ]  # fmt: skip
    stop: Any = "stop"
    far = module.separation(of.fitted, of.at, TILT, [drag, friction, drift, of.tilt, of.mode], stop)
    size = math.sqrt(whole)
    assert far.snr == pytest.approx(size)
    assert far.from_other == pytest.approx(
        {DRAG: 0.5 * size, friction.effect: 0.0, drift.effect: size}
    )  # what the fit has is no other
    assert far.starts == {DRAG: "best", friction.effect: "all"}
    assert of.asked == ([DRAG, friction.effect, drift.effect], stop)
