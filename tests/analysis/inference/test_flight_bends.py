"""The accelerations of flights: of one law for all, or of each for itself, with white noise that is learned."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from analysis.inference.noise import per_shot_acceleration as module
from analysis.inference.noise.per_shot_acceleration import _Flight, _flights, _log_likelihood

COUNT, SPACING_S = 4, 1e-3
LAWS = np.array([[1.0, 0.5], [1.0, -0.5], [1.0, 2.0], [1.0, -1.0]])


def made(bends: list[float], seed: int = 1) -> list[_Flight]:
    random = np.random.default_rng(seed)
    out = []
    for k, bend in enumerate(bends):
        u = (np.arange(100) - 49.5) * SPACING_S
        valid = np.arange(100) != 30 + k
        noise = 1e-6 * random.standard_normal(100)
        columns = np.stack([np.ones(100), u, 0.5 * u**2], axis=1)
        x = columns @ [0.1 * k, -0.3, bend] + noise
        out.append(_Flight(valid, np.where(valid, x, 9.0), columns, np.zeros(5), 1.0))
    return out


@pytest.mark.parametrize(("one_way", "acting"), [([False, False], 2), ([False, True], 1)])
def test_the_likelihood_is_that_of_lines_with_bends_of_the_laws(one_way: list[bool], acting: int) -> None:
    flights = made((LAWS @ [0.2, -3e-4]).tolist())
    value, found = _log_likelihood(flights, LAWS, np.array(one_way), SPACING_S)
    rows, left = [], []
    for k, flight in enumerate(flights):
        lines = np.zeros((100, 2 * COUNT))
        lines[:, 2 * k : 2 * k + 2] = flight.columns[:, :2]
        rows.append(np.column_stack([lines, flight.columns[:, 2:] * LAWS[k]])[flight.valid])
        left.append(flight.displacement_m[flight.valid])
    design, target = np.concatenate(rows), np.concatenate(left)
    scale = np.linalg.norm(design, axis=0)
    low = np.concatenate([np.full(2 * COUNT, -np.inf), np.where(one_way, 0.0, -np.inf)])
    best = lsq_linear(design / scale, target, (low, np.inf), method="bvls")
    square = float(np.mean((target - design / scale @ best.x) ** 2))
    assert value == pytest.approx(-0.5 * target.size * (math.log(2 * math.pi * square) + 1), abs=0.5)
    assert found == acting


def test_a_shots_flights_begin_and_end_clear_of_its_contact() -> None:
    time_s = 0.001 * np.arange(400)
    course = SimpleNamespace(touch_time_s=0.1, release_time_s=0.2, contact_time_s=0.1, touch_position_m=0.5)
    place = np.where(time_s < 0.15, 0.5 - 2.0 * (time_s - 0.1), 0.5 + 1.5 * (time_s - 0.2))
    valid = np.ones(400, dtype=bool)
    valid[[0, 1, 50, 399]] = False
    shot: Any = SimpleNamespace(
        course=course, centre_s=time_s, spacing_s=0.001, valid=valid, displacement_m=place, weight=1.3
    )
    before, after = _flights(shot)
    assert before.valid.size == 97 - 2 and after.valid.size == 399 - 216  # three samples, and 0.15 of the contact
    for flight, speed, begin in ((before, -2.0, 2), (after, 1.5, 216)):
        t = time_s[begin : begin + flight.valid.size]
        u = t - t[flight.valid].mean()
        np.testing.assert_allclose(flight.columns, np.stack([np.ones(u.size), u, 0.5 * u**2], axis=1), atol=1e-15)
        away = place[begin + np.flatnonzero(flight.valid)].mean() - 0.5
        np.testing.assert_allclose(flight.laws, [1.0, -np.sign(speed), -speed, -speed * abs(speed), away])
        assert flight.weight == 1.3
    shot.valid = valid & ((time_s > 0.0665) | (time_s < 0.0))  # thirty samples before the touch, then one less
    assert len(list(_flights(shot))) == 2
    shot.valid = valid & (time_s > 0.0675)
    assert len(list(_flights(shot))) == 1


def test_flights_are_of_their_own_where_a_shared_law_explains_too_little(monkeypatch: pytest.MonkeyPatch) -> None:
    def asked(gain: float, shots: int = 3, wavelength_m: float | None = None) -> bool:
        values = iter([(10.0, 3), (10.0 + gain, 6)])
        monkeypatch.setattr(module, "_log_likelihood", lambda *_: next(values))
        monkeypatch.setattr(module, "_flights", lambda shot: [SimpleNamespace(laws=np.zeros(5))] * 2)
        given: Any = [SimpleNamespace(wavelength_m=wavelength_m, spacing_s=1.0)] * shots
        return bool(module.per_shot_nuisances(given, 0.05))

    limit = 7.815 / 2  # of chi^2 with three degrees of freedom, one in twenty
    assert asked(1.001 * limit) and not asked(0.999 * limit)
    assert not asked(99.0, shots=2) and not asked(99.0, wavelength_m=6e-7)
