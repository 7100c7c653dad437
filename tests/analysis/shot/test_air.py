from dataclasses import replace

import pytest

from analysis.shot.air import refractive_index, wavelength_in_air_m
from analysis.shot.recording import DEFAULT_WAVELENGTH_AIR_M, Air, Setup

LABORATORY = Air(20.0, 101325.0, 50.0)
ZEEMAN_VACUUM_M = 632.991354e-9


@pytest.mark.parametrize(
    ("celsius", "kilopascal", "percent", "nanometre", "index"),
    [
        (20.0, 101.325, 0.0, 633.0, 1.000271800),
        (20.0, 60.0, 0.0, 633.0, 1.000160924),
        (20.0, 120.0, 0.0, 633.0, 1.000321916),
        (50.0, 100.0, 0.0, 633.0, 1.000243285),
        (5.0, 100.0, 0.0, 633.0, 1.000282756),
        (-40.0, 100.0, 0.0, 633.0, 1.000337580),
        (20.0, 101.325, 50.0, 633.0, 1.000271373),
        (50.0, 120.0, 100.0, 633.0, 1.000287924),
        (40.0, 120.0, 75.0, 633.0, 1.000299418),
        (20.0, 100.0, 100.0, 633.0, 1.000267394),
        (40.0, 110.0, 100.0, 1700.0, 1.000270247),
        (20.0, 101.325, 0.0, 1700.0, 1.000268479),
    ],
)
def test_the_index_is_that_of_the_published_table(
    celsius: float, kilopascal: float, percent: float, nanometre: float, index: float
) -> None:
    """Stone and Zimmerman, "Index of refraction of air", NIST Engineering Metrology Toolbox: Ciddor's equation."""
    air = Air(celsius, 1e3 * kilopascal, percent)
    assert refractive_index(1e-9 * nanometre, air) == pytest.approx(index, abs=1.0e-9)


@pytest.mark.parametrize(
    ("air", "change", "tolerance"),
    [
        (Air(21.0, 101325.0, 50.0), -0.95e-6, 0.02e-6),
        (Air(20.0, 101425.0, 50.0), 0.268e-6, 0.002e-6),
        (Air(20.0, 101325.0, 51.0), -0.0085e-6, 0.0003e-6),
    ],
)
def test_sensitivities(air: Air, change: float, tolerance: float) -> None:
    base = refractive_index(ZEEMAN_VACUUM_M, LABORATORY)
    assert refractive_index(ZEEMAN_VACUUM_M, air) - base == pytest.approx(change, abs=tolerance)


def test_the_wavelength_is_in_air_else_vacuum_over_index_else_the_papers() -> None:
    given = Setup(0.01785, wavelength_vacuum_m=ZEEMAN_VACUUM_M, wavelength_air_m=632.8e-9, air=LABORATORY)
    assert wavelength_in_air_m(given) == 632.8e-9
    computed = wavelength_in_air_m(Setup(0.01785, wavelength_vacuum_m=ZEEMAN_VACUUM_M, air=LABORATORY))
    assert computed == pytest.approx(632.8196e-9, abs=1e-13)
    assert wavelength_in_air_m(Setup(0.01785, wavelength_vacuum_m=ZEEMAN_VACUUM_M)) == computed
    assert wavelength_in_air_m(Setup(0.01785)) == DEFAULT_WAVELENGTH_AIR_M


@pytest.mark.parametrize("air", [Air(float("nan"), 101325.0, 50.0), Air(20.0, -1.0, 50.0), Air(20.0, 1e5, 130.0)])
def test_impossible_air_is_refused_by_name(air: Air) -> None:
    with pytest.raises(ValueError, match=r"temperature_c|pressure_pa|humidity_percent"):
        refractive_index(ZEEMAN_VACUUM_M, air)


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ({"temperature_c": -40.0}, {"temperature_c": -40.1}),
        ({"temperature_c": 100.0}, {"temperature_c": 100.1}),
        ({"pressure_pa": 1e4}, {"pressure_pa": 9.9e3}),
        ({"pressure_pa": 1.4e5}, {"pressure_pa": 1.41e5}),
        ({"humidity_percent": 0.0}, {"humidity_percent": -0.1}),
        ({"humidity_percent": 100.0}, {"humidity_percent": 100.1}),
    ],
)
def test_air_is_known_up_to_its_limits(within: dict[str, float], beyond: dict[str, float]) -> None:
    assert 1.0 < refractive_index(ZEEMAN_VACUUM_M, replace(LABORATORY, **within)) < 1.0006
    with pytest.raises(ValueError, match=next(iter(beyond))):
        refractive_index(ZEEMAN_VACUUM_M, replace(LABORATORY, **beyond))


def test_a_wavelength_is_one_of_light() -> None:
    for wavelength in (3e-7, 1.7e-6):
        refractive_index(wavelength, LABORATORY)
    for wavelength in (2.9e-7, 1.8e-6):
        with pytest.raises(ValueError, match="wavelength_vacuum_m"):
            refractive_index(wavelength, LABORATORY)
    for wavelength in (1.1e-7, 0.9e-5):
        assert wavelength_in_air_m(Setup(0.01785, wavelength_air_m=wavelength)) == wavelength
    for wavelength in (1e-7, 1e-5):
        with pytest.raises(ValueError, match="wavelength_air_m"):
            wavelength_in_air_m(Setup(0.01785, wavelength_air_m=wavelength))
