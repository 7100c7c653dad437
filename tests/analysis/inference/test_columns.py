"""Products of effects' columns with each other and with a residual, against dense projections of the columns."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.inference.fit.problem import Linearised
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.screen import columns as module
from analysis.inference.screen.columns import (
    ColumnProducts,
    column_products,
    contribution_of,
    own_columns,
    products_along_paths,
)
from tests.analysis.diagnosis.shots import KINDS, base_fit, shots

FEW: Any = pytest.mark.parametrize("few", [0, 100])


def some(name: str) -> TrialEffect:
    between = [start for start in KINDS[name].starts if 50.0 < start["frequency_hz"] < 1500.0]
    return replace(KINDS[name], starts=tuple(between[:: len(between) // 4]))


@pytest.fixture(scope="module")
def at() -> Linearised:
    return base_fit(shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-6}}, count=2)).linearise()


def dense(at: Linearised, bare: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return squared norms of columns, of their parts that no parameter makes, and products with the residual."""
    white = np.concatenate([s.whitened(at.noise, c) for s, c in zip(at.problem.data.shots, bare, strict=True)])
    tangents = np.zeros((len(white), at.tangents.size))
    for block, places, part in zip(at.tangents.blocks, at.tangents.places, at.tangents.parts(tangents), strict=True):
        part[:, places] = block
    basis = np.linalg.qr(tangents / np.linalg.norm(tangents, axis=0))[0]
    new = white - basis @ (basis.T @ white)
    new = new - basis @ (basis.T @ new)
    return np.sum(white**2, axis=0), np.sum(new**2, axis=0), new.T @ at.whole


def agree(found: ColumnProducts, expected: tuple[np.ndarray, np.ndarray, np.ndarray], rel: float) -> None:
    for mine, theirs in zip((found.whole, found.power, found.along), expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=rel, atol=rel * np.abs(theirs).max())


@FEW
def test_products_are_those_of_columns_that_the_fit_cannot_make(at: Linearised, few: int) -> None:
    """By a trajectory for each start, or to first order for all of them."""
    kind = some("block_mode")
    found = column_products(at, kind, kind.starts, few)
    assert found.starts == list(kind.starts) and len(kind.starts) > 3
    bare = [
        np.column_stack([column for start in kind.starts if (column := one_by_one(at, kind, start)[index]) is not None])
        for index in range(2)
    ]
    agree(found, dense(at, bare), 1e-6 if few else 0.05)
    fresh = replace(at, done={})
    kept = column_products(fresh, kind, kind.starts, few, kept=True)
    agree(kept, (found.whole, found.power, found.along), 1e-9)
    how = "trajectories" if few else "first order"  # whitened columns of each shot are there for the next score
    assert {key for key in fresh.done if " of " in key} == {f"{how} of block_mode, shot {k}" for k in (0, 1)}


def one_by_one(at: Linearised, kind: TrialEffect, start: Any) -> list[np.ndarray]:
    added = contribution_of(at, kind, [start, start])
    assert added is not None
    return added


def test_of_many_shots_the_products_along_common_paths_are_the_same(
    at: Linearised, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = [some("block_mode"), some("second_plate_mode"), KINDS["viscous_drag"], KINDS["frame_vibration"]]
    assert products_along_paths(at, kinds) == {}
    monkeypatch.setattr(module, "FEW_SHOTS", 1)
    monkeypatch.setattr(module, "MANY_STARTS", 3)
    found = products_along_paths(at, kinds)
    assert set(found) == {kinds[0].effect, kinds[1].effect}
    for kind in kinds[:2]:
        alone = column_products(replace(at, done={}), kind, kind.starts, 3)
        agree(found[kind.effect], (alone.whole, alone.power, alone.along), 1e-9)
        assert found[kind.effect].starts == alone.starts


def test_a_line_beyond_the_band_of_the_records_is_not_looked_at(at: Linearised) -> None:
    kind = KINDS["block_mode"]
    slowest, fastest = at.problem.data.band_hz
    starts = [{**kind.starts[0], "frequency_hz": f} for f in (slowest, 1.01 * slowest, 0.99 * fastest, fastest)]
    assert module._inside(at, starts) == starts[1:3]
    without = [{"force_n": 1.0}]
    assert module._inside(at, without) == without


def test_each_shot_may_have_values_of_its_own(at: Linearised) -> None:
    kind = KINDS["plate_motion"]
    rests, swings = ({"velocity_m_per_s": v, "displacement_m": 0.0} for v in (0.0, 1e-6))
    both = contribution_of(at, kind, [swings, rests])
    assert both is not None
    assert np.abs(both[0]).max() > 1e3 * np.abs(both[1]).max()
    own = own_columns(at, kind, [swings, rests])
    assert own is not None
    np.testing.assert_allclose(own[0][:, 0], both[0], atol=1e-9 * np.abs(both[0]).max())
    assert own[1].shape[1] == 2 and np.abs(own[1][:, 1]).max() < 1e-3 * np.abs(own[1][:, 0]).max()


def test_where_an_effect_has_no_motion_there_is_no_column(at: Linearised, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = KINDS["viscous_drag"]

    def refused(*_: Any) -> Any:
        raise Infeasible("none")

    monkeypatch.setattr(module, "to_physical", refused)
    starts = [{"coefficient_n_s_per_m": 1.7e-4}]
    assert contribution_of(at, kind, starts * 2) is None and own_columns(at, kind, starts) is None
    assert column_products(at, kind, starts, 5).starts == []
