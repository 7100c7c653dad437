"""The sources of a shot's budget one by one: their size, their kind, and what they are shared by."""

import math
from dataclasses import replace

import pytest

from analysis.shot.air import STANDARD_AIR, Air, refractive_index
from analysis.shot.motion import BeatQuality
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Setup
from analysis.uncertainty.budget_sources import BudgetRow, InstrumentUncertainty, ShotSources, _last_digit
from tests.analysis.shots import shot_of
from tests.analysis.synthetic_collision import Synthetic, motion_of

KNOWN = InstrumentUncertainty()
LASER = Setup(moving_mass_kg=17.85e-3, moving_mass_u_kg=2e-6, wavelength_vacuum_m=632.991354e-9, air=STANDARD_AIR)


def _parts(number: object, sources: ShotSources) -> dict[str, tuple[str, float]]:
    """Return the type and the contribution of each source of a number, by name."""
    return {
        row.source: (row.kind, row.contribution)
        for row in (sources.row(*one, 0.0) for one in number.derivatives.items())  # type: ignore[attr-defined]
    }


def test_limits_are_rectangles_and_the_cosine_counts_with_its_mean() -> None:
    assert KNOWN.timebase_u == pytest.approx(25e-6 / math.sqrt(3)) and KNOWN.instant_u_s == pytest.approx(
        1e-6 / math.sqrt(3)
    )
    assert KNOWN.mass_u_kg == pytest.approx(5e-6 / math.sqrt(3))
    largest = 0.5 * 2e-3**2  # 1 / cos a - 1, uniform from 0 to this: mean and deviation squared sum to a third of it
    assert KNOWN.alignment_u == pytest.approx(math.sqrt((largest / 2) ** 2 + largest**2 / 12), rel=1e-12)
    for name in ("mass_u_kg", "air_temperature_u_k", "instant_limit_s", "rest_frequency_u_hz"):
        InstrumentUncertainty(**{name: 0.0})  # type: ignore[arg-type]
        for wrong in (-1e-9, math.inf):
            with pytest.raises(ValueError, match=name):
                InstrumentUncertainty(**{name: wrong})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="thickness_m"):
        InstrumentUncertainty(plate=replace(KNOWN.plate, thickness_m=-1.0))


def test_what_has_no_uncertainty_is_a_plain_number() -> None:
    table = ShotSources(shot_of(setup=LASER), KNOWN)
    for std in (0.0, -1.0, math.nan, math.inf):
        assert table.number(2.0, std, "x", "A", "m", "") == 2.0
    variable = table.number(2.0, 0.5, "x", "A", "m", "how")
    assert (variable.nominal_value, variable.std_dev) == (2.0, 0.5)  # type: ignore[union-attr]
    assert table.row(variable, 3.0, 1.0) == BudgetRow("x", "A", 0.5, "m", 3.0, "how")
    assert table.row(variable, 3e-16, 1.0).sensitivity == 0.0  # what is left by rounding


def test_a_contradicted_rate_is_the_clock_s_uncertainty_and_is_taken_from_each_reading() -> None:
    motion = replace(motion_of(Synthetic()), rate_error=3e-3, moving_mass_u_kg=0.0)
    sources = ShotSources(shot_of(setup=LASER, motion=motion), KNOWN)
    assert sources.timebase.std_dev == pytest.approx(math.hypot(3e-3, KNOWN.timebase_u))  # type: ignore[union-attr]
    carried = 2 * 0.5 * 3e-3
    reading = Quantity(0.5, math.hypot(1e-3, carried), "how")
    assert sources.with_type_a(reading, "n", "N").std_dev == pytest.approx(1e-3)  # type: ignore[union-attr]
    assert sources.with_type_a(reading, "n", "m").std_dev == reading.std  # type: ignore[union-attr]
    less = Quantity(0.5, 1e-6, "")
    assert sources.with_type_a(less, "n", "N") == 0.5  # all of it is the clock's
    for unseen in (NotSeen("x"), None, Quantity(math.nan, 1.0), Quantity(1.0, math.nan)):
        assert sources.with_type_a(unseen, "n", "N") is None
    whole = ShotSources(shot_of(setup=LASER), KNOWN)
    assert whole.with_type_a(reading, "n", "N").std_dev == reading.std  # type: ignore[union-attr]


def test_the_mass_s_part_is_taken_from_a_reading_that_includes_it() -> None:
    motion = replace(motion_of(Synthetic()), moving_mass_u_kg=5e-5)
    sources = ShotSources(shot_of(setup=LASER, motion=motion), KNOWN)
    carried = 0.5 * 5e-5 / motion.moving_mass_kg
    reading = Quantity(0.5, math.hypot(1e-3, carried), "")
    assert sources.with_type_a(reading, "n", "N", without_mass=True).std_dev == pytest.approx(1e-3)  # type: ignore[union-attr]
    assert _parts(sources.mass_scale, sources) == {
        "mass": ("B", pytest.approx(5e-5 / motion.moving_mass_kg))
    }  # the larger one


def test_an_interval_has_noise_and_the_band_s_shift_and_runs_on_the_clock() -> None:
    sources = ShotSources(shot_of(setup=LASER), KNOWN)
    parts = _parts(sources.interval(2e-3, 3e-7, "T1", "how"), sources)
    assert parts == {
        "beat noise, T1": ("A", pytest.approx(3e-7)),
        "bandwidth, T1": ("B", pytest.approx(KNOWN.instant_u_s)),
        "timebase": ("B", pytest.approx(2e-3 * KNOWN.timebase_u)),
    }


def test_velocity_takes_the_clock_once_and_all_share_the_same_variables() -> None:
    sources = ShotSources(shot_of(setup=LASER), KNOWN)
    assert _parts(sources.velocity_scale, sources)["timebase"] == ("B", pytest.approx(KNOWN.timebase_u))
    assert (sources.velocity_scale * sources.timebase / sources.length_scale).std_dev == pytest.approx(0.0, abs=1e-15)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("setup", "name", "std"),
    [
        (LASER, "wavelength in vacuum", 1e-7),
        (replace(LASER, wavelength_air_m=632.8e-9), "wavelength in air", 0.05e-9 / math.sqrt(3) / 632.8e-9),
        (replace(LASER, wavelength_vacuum_m=None), "wavelength in air", 0.05e-9 / math.sqrt(3) / 632.8e-9),
    ],
)
def test_the_wavelength_used_is_the_one_that_is_uncertain(setup, name, std) -> None:
    sources = ShotSources(shot_of(setup=setup), KNOWN)
    parts = _parts(sources.length_scale, sources)
    assert parts[name] == ("B", pytest.approx(std, rel=1e-6)) and sources.length_scale.nominal_value == pytest.approx(
        1.0
    )
    assert sum(key.startswith("wavelength") for key in parts) == 1


@pytest.mark.parametrize("air", [STANDARD_AIR, Air(0.0, 90e3, 0.0), Air(25.0, 101325.0, 80.0)])
def test_the_air_counts_with_the_slope_of_its_index(air: Air) -> None:
    sources = ShotSources(shot_of(setup=replace(LASER, air=air)), KNOWN)
    parts = _parts(sources.length_scale, sources)
    n = refractive_index(632.991354e-9, air)
    for name, moved, std in (
        ("air temperature", replace(air, temperature_c=air.temperature_c + 0.1), KNOWN.air_temperature_u_k / 0.1),
        ("air pressure", replace(air, pressure_pa=air.pressure_pa + 10.0), KNOWN.air_pressure_u_pa / 10.0),
        ("air humidity", replace(air, humidity_percent=air.humidity_percent + 1.0), KNOWN.air_humidity_u_percent),
    ):
        slope = abs(refractive_index(632.991354e-9, moved) / n - 1.0)
        assert parts[name] == ("B", pytest.approx(slope * std, rel=0.02))


def test_a_rest_frequency_is_as_uncertain_as_it_was_measured_stated_or_assumed() -> None:
    def moved(shot: object) -> dict[str, tuple[str, float]]:
        sources = ShotSources(shot, KNOWN)  # type: ignore[arg-type]
        return {} if sources.rest_velocity_m_per_s == 0.0 else _parts(sources.rest_velocity_m_per_s, sources)

    rest = Quantity(2.7e6, 30.0, "PD0")
    motion = replace(motion_of(Synthetic()), rest_frequency_hz=rest)
    half = 0.5 * motion.wavelength_m
    measured = replace(motion, reference=BeatQuality(2.7e6, 0.4, 40.0, 0.0))
    assert moved(shot_of(setup=LASER, motion=measured)) == {"rest frequency": ("A", pytest.approx(half * 30.0))}
    assert moved(shot_of(setup=LASER, motion=motion)) == {"rest frequency": ("B", pytest.approx(half * 100.0))}
    stated = replace(LASER, rest_frequency_u_hz=7.0)
    assert moved(shot_of(setup=stated, motion=motion)) == {"rest frequency": ("B", pytest.approx(half * 7.0))}
    wrong = replace(motion, rate_error=1e-5)
    both = math.hypot(7.0, 27.0)
    assert moved(shot_of(setup=stated, motion=wrong)) == {"rest frequency": ("B", pytest.approx(half * both))}
    assert (
        moved(shot_of(setup=LASER, motion=replace(motion, wavelength_m=None)))
        == {}
        == moved(shot_of(setup=LASER, motion=None))
    )
    assert moved(shot_of(setup=LASER, motion=replace(measured, rest_frequency_hz=NotSeen("x")))) == {}


@pytest.mark.parametrize(
    ("nanometres", "half"), [(632.8, 0.05), (633.0, 0.05), (632.82, 0.005), (632.8196, 5e-5), (632.991354, 5e-5)]
)
def test_the_last_digit_of_a_stated_wavelength(nanometres: float, half: float) -> None:
    assert 1e9 * _last_digit(nanometres * 1e-9) == pytest.approx(half)
