"""Products of columns beside a frame that sways, against those of columns that are whitened one by one."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.inference.noise.floor import Floor
from analysis.inference.screen.lines import _gain, _waves
from analysis.inference.screen.whitened_columns import WhitenedColumns
from tests.analysis.inference.test_site import a_noise, a_sway

WANDER_M = pytest.mark.parametrize("wander_m", [0.0, 2.0])
SITE = pytest.mark.parametrize("strengths", [(), (-2.0, 1.5)])


def a_shot() -> SimpleNamespace:
    """Return what of a shot is looked at: 60 samples of which two are missing, and a sway of the others."""
    valid = np.ones(62, np.bool_)
    valid[[20, 41]] = False
    sway = a_sway(np.random.default_rng(1))
    return SimpleNamespace(valid=valid, weight=1.2, sway=type(sway)(sway.basis, sway.factors, sway.band, valid, 1.2))


def whitened(shot: SimpleNamespace, noise: Floor, columns: np.ndarray) -> np.ndarray:
    white = noise.whiten(columns, shot.valid, shot.weight)
    return shot.sway.whiten(white, noise) if noise.site else white


@WANDER_M
@SITE
def test_products_are_those_of_whitened_columns(strengths: tuple[float, ...], wander_m: float) -> None:
    shot, noise = a_shot(), a_noise(0.3, strengths, wander_m)
    random = np.random.default_rng(2)
    columns, rows = random.standard_normal((62, 6)), random.standard_normal((60, 3))
    white = whitened(shot, noise, columns)
    found = WhitenedColumns.of(shot, noise, columns)
    np.testing.assert_allclose(found.products(), np.sum(white**2, axis=0), rtol=1e-9)
    some, others = slice(0, 3), slice(3, None)
    np.testing.assert_allclose(found.products(some, others), np.sum(white[:, :3] * white[:, 3:], axis=0), atol=1e-9)
    np.testing.assert_allclose(found.products_with(rows), rows.T @ white, atol=1e-9)


@WANDER_M
@SITE
def test_a_line_takes_what_a_least_squares_fit_of_it_takes(strengths: tuple[float, ...], wander_m: float) -> None:
    shot, noise = a_shot(), a_noise(0.3, strengths, wander_m)
    random = np.random.default_rng(3)
    basis = np.linalg.qr(random.standard_normal((60, 4)))[0]
    left = random.standard_normal(60)
    left -= basis @ (basis.T @ left)
    frequency_hz = np.array([700.0, 1900.0])
    bare = _waves(frequency_hz, np.arange(62) * noise.spacing_s)
    gains = _gain(WhitenedColumns.of(shot, noise, bare), np.column_stack([basis, left]))
    white = whitened(shot, noise, bare)
    for k, gain in enumerate(gains):
        design = np.column_stack([basis, white[:, [k, 2 + k]]])
        rest = left - design @ np.linalg.lstsq(design, left, rcond=None)[0]
        assert gain == pytest.approx(float(left @ left - rest @ rest), rel=1e-8)
