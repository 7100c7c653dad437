"""What screening says that laws would remove is what a fit with them removes."""

import itertools

import numpy as np
import pytest

from analysis.drive import law_screening
from analysis.drive.catalogue import LAWS
from analysis.drive.law_screening import CandidateLaws, _best, _ripple_pitches, grid_points, screen_laws
from analysis.drive.regression import Regression, regress
from analysis.drive.stretch import Table, low_pass, prepare
from analysis.inference import orthonormal
from tests.analysis.drive.slider import Drive


@pytest.fixture(scope="module")
def table() -> Table:
    drive = Drive(lambda x, v: 20.0 * np.sign(v) + 2e4 * x**3 + 9.0 * np.abs(v), 3e-3, encoder_m=2e-6, seconds=20.0)
    return Table.of(prepare([drive.motion()]))


def squares(found: Regression) -> float:
    return float(np.sum(found.residual_n[found.mask] ** 2))


LINEAR = ("coulomb_friction", "quadratic_drag", "bearing_gradient", "place_dependent_friction")
SHAPED = ("stribeck_friction", "presliding_friction", "drive_delay")


@pytest.mark.parametrize("given", [(), ("cubic_stiffness", "directional_viscous_drag")])
def test_a_candidate_would_remove_what_a_fit_at_the_same_shape_removes(table: Table, given: tuple[str, ...]) -> None:
    """Single laws and pairs, of the samples that the model was fitted to."""
    found = regress(table, given, table.time_s < 13.0)
    screened = screen_laws(table, found, laws=(*given, *LINEAR, *SHAPED))
    assert screened.unidentifiable == ()
    assert {one.laws for one in screened.singles} == {(law,) for law in (*LINEAR, *SHAPED)}
    pairs = {frozenset(one.laws) for one in screened.pairs}
    assert pairs == {frozenset(two) for two in itertools.combinations((*LINEAR, *SHAPED), 2)}
    for candidates in (screened.singles, screened.pairs):
        assert [c.gain_n2 for c in candidates] == sorted((c.gain_n2 for c in candidates), reverse=True)
    some = [*screened.singles, *screened.pairs[:3], *screened.pairs[-3:]]
    some += [pair for pair in screened.pairs if "drive_delay" in pair.laws]
    for candidate in some:
        assert set(candidate.nonlinear) == {name for law in candidate.laws for name in LAWS[law].nonlinear_names}
        more = regress(table, (*given, *candidate.laws), found.mask, None, candidate.nonlinear)
        assert candidate.gain_n2 == pytest.approx(squares(found) - squares(more), rel=1e-5), candidate
    # and of a law's grid it is the best point
    for law in ("stribeck_friction", "drive_delay"):
        (name,) = LAWS[law].nonlinear_names
        fits = [
            regress(table, (*given, law), found.mask, None, {name: at})
            for (at,) in grid_points(LAWS[law], table.stretches)
        ]
        best = next(c for c in screened.singles if c.laws == (law,))
        assert best.gain_n2 == pytest.approx(squares(found) - min(map(squares, fits)), rel=1e-5)


def test_a_delay_that_the_model_has_is_where_a_further_one_is_counted_from(table: Table) -> None:
    without = screen_laws(table, regress(table), laws=("drive_delay",), pairs=False)
    assert without.pairs == () and len(without.singles) == 1
    found = regress(table, ("drive_delay",), None, None, {"drive_delay.time_s": 4e-3})
    assert screen_laws(table, found, laws=("drive_delay", "coulomb_friction")).pairs == ()
    basis = orthonormal(found.tangents)
    later = law_screening._delayed(table, found, basis)
    period_s = 1.0 / table.stretches[0].bandwidth_hz
    assert sorted(later) == pytest.approx([k * 0.025 * period_s for k in range(-8, 9) if k])
    for at, left in later.items():
        exact = table.force(at) - basis @ (basis.T @ table.force(at))
        np.testing.assert_allclose(left, exact, atol=1e-6)


def test_a_law_that_is_a_sum_of_the_models_own_is_not_identifiable() -> None:
    one_way = Table.of(prepare([Drive(seconds=9.0, steady_m_per_s=2.0, encoder_m=1e-6).motion()]))
    screened = screen_laws(one_way, regress(one_way))
    assert {"coulomb_friction", "directional_viscous_drag"} <= set(screened.unidentifiable)
    assert not {law for c in (*screened.singles, *screened.pairs) for law in c.laws} & set(screened.unidentifiable)
    assert "bearing_gradient" not in screened.unidentifiable


def test_a_laws_grid_is_every_combination_in_its_units(table: Table) -> None:
    travel, fastest = np.ptp(table.displacement_m), np.abs(table.velocity_m_per_s).max()
    points = grid_points(LAWS["lugre_friction"], table.stretches)
    expected = [(r * travel, s * fastest, 0.5) for r in (1e-4, 1e-3) for s in (0.03, 0.1)]
    np.testing.assert_allclose(points, expected)
    assert grid_points(LAWS["coulomb_friction"], table.stretches) == [()]


def test_of_one_set_of_laws_the_best_candidate_stays() -> None:
    def of(name: str, gain: float) -> CandidateLaws:
        return CandidateLaws((name,), {}, gain)

    assert _best([of("a", 1.0), of("b", 5.0), of("a", 3.0), of("b", 2.0)]) == (of("b", 5.0), of("a", 3.0))


@pytest.mark.parametrize(("encoder_m", "seed"), [(1e-6, 1), (1e-6, 2), (1e-6, 3), (2.7e-8, 4), (2.7e-8, 5)])
def test_the_waves_of_a_ripple_are_those_that_remove_most_of_a_residual(encoder_m: float, seed: int) -> None:
    """Of one that is nothing but noise, every wave that the filter lets through is as likely: all are tried."""
    table = Table.of(prepare([Drive(encoder_m=encoder_m, seconds=9.0).motion()]))
    found = regress(table, (), table.time_s > 3.0)
    basis = orthonormal(found.tangents[found.mask])
    noise = np.random.default_rng(seed).standard_normal(basis.shape[0])
    left = noise - basis @ (basis.T @ noise)
    pitches = [pitch for (pitch,) in _ripple_pitches(table, found.mask, basis, left)]
    place, speed = table.displacement_m[found.mask], np.abs(table.velocity_m_per_s[found.mask])
    travel, part = np.ptp(place), table.stretches[0]
    taps = low_pass(part.sample_rate_hz, part.bandwidth_hz)
    at = (np.arange(taps.size) - taps.size // 2) / part.sample_rate_hz
    tones = np.linspace(0.0, 3.0 * part.bandwidth_hz, 61)
    passed = np.cos(2 * np.pi * np.outer(tones, at)) @ taps
    waves = np.arange(1.5, 1.5 * part.bandwidth_hz * travel / np.quantile(speed, 0.2), 0.4)
    assert 100 < waves.size < 1000 if encoder_m > 1e-7 else waves[-1] > 400.0
    waves = waves[waves < 400.0]
    gains = []
    for wave in waves:
        angle, through = 2 * np.pi * wave * place / travel, np.interp(speed * wave / travel, tones, passed, right=0.0)
        columns = np.stack([np.sin(angle) * through, np.cos(angle) * through], axis=1)
        columns -= basis @ (basis.T @ columns)
        gains.append(np.sum(left**2) - np.linalg.lstsq(columns, left, rcond=None)[1].sum())
    chosen: list[float] = []
    for wave in waves[np.argsort(gains)[::-1]]:
        if all(abs(wave - other) > 1.0 for other in chosen):
            chosen.append(wave)
    np.testing.assert_allclose(travel / np.array(pitches), chosen[:3], rtol=1e-9)
