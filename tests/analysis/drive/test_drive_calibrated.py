"""The ± of a drive's parameters is their scatter over a hundred records of one drive."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.drive.regression import Regression, regress
from analysis.drive.stretch import Table, prepare
from tests.analysis.drive.slider import MASS, OFFSET, VISCOUS, Drive, Floats

RECORDS = 100


def _fitted(drive: Callable[[int], Drive], laws: tuple[str, ...]) -> list[Regression]:
    start = {"position_ripple.pitch_m": 0.0131}
    return [regress(Table.of(prepare([drive(seed).motion()])), laws, None, start) for seed in range(RECORDS)]


@pytest.mark.parametrize(
    ("extra", "laws", "true"),
    [
        (lambda x, v: 0.0 * x, (), {}),
        (
            lambda x, v: 150.0 * v * np.abs(v) + 80.0 * x,
            ("quadratic_drag", "bearing_gradient"),
            {"quadratic_drag.coefficient_n_s2_per_m2": 150.0, "bearing_gradient.stiffness_n_per_m": 80.0},
        ),
        (
            lambda x, v: 2.0 * np.sin(2 * np.pi * x / 0.013),
            ("position_ripple",),
            {"position_ripple.pitch_m": 0.013},
        ),
    ],
)
def test_parameters_scatter_as_their_uncertainties_say(
    extra: Callable[[Floats, Floats], Floats], laws: tuple[str, ...], true: dict[str, float]
) -> None:
    fits = _fitted(lambda seed: Drive(extra, seed=seed, noise_n=1.0, seconds=8.0), laws)
    base = {"moving_mass_kg": MASS, "viscous_coefficient_n_s_per_m": VISCOUS, "offset_n": OFFSET}
    for name, value in (base | true).items():
        found = [fit.quantity(name) for fit in fits]
        pulls = np.array([(q.value - value) / q.std for q in found])
        scatter = float(np.std([q.value for q in found], ddof=1) / np.sqrt(np.mean([q.std**2 for q in found])))
        assert 0.8 < scatter < 1.25, (name, scatter)
        assert abs(float(np.median(pulls))) < 0.5, name
