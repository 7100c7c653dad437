"""The budget against hand-made derivatives, against a Monte Carlo of the measurement, and its form in the result."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.reading import SLOPE_SPAN
from analysis.shot.air import STANDARD_AIR, wavelength_in_air_m
from analysis.shot.motion import BeatQuality
from analysis.shot.plate import PlateTolerance
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Plate, Setup
from analysis.shot.shot import Shot
from analysis.uncertainty import gum_budget as table
from analysis.uncertainty.budget_sources import InstrumentUncertainty
from analysis.uncertainty.gum_budget import QuantityBudget, budget
from tests.analysis.shot.test_plate import modulus_pa
from tests.analysis.shots import at_speed, paper_impact, shot_of
from tests.analysis.synthetic_collision import Synthetic, motion_of

LASER = Setup(
    moving_mass_kg=17.85e-3, moving_mass_u_kg=2e-6, wavelength_vacuum_m=632.991354e-9, air=STANDARD_AIR,
    plate=Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8510.0, 131e9),
)  # fmt: skip


def of(shot: Shot, key: str, **known: float) -> QuantityBudget:
    found = budget(shot, InstrumentUncertainty(**known)).of(key)  # type: ignore[arg-type]
    assert found is not None
    return found


def contribution(table: QuantityBudget, source: str) -> float:
    return next(row.contribution for row in table.rows if row.source == source)


def test_each_source_of_velocity_by_hand() -> None:
    v = of(shot_of(setup=LASER), "velocity_in_m_per_s", wavelength_vacuum_relative=3e-7)
    assert contribution(v, "wavelength in vacuum") == pytest.approx(0.265 * 3e-7, rel=1e-9)
    assert contribution(v, "timebase") == pytest.approx(0.265 * 25e-6 / math.sqrt(3), rel=1e-9)
    assert contribution(v, "alignment (cosine)") == pytest.approx(0.265 * 0.5 * 4e-6 / math.sqrt(3), rel=1e-9)
    assert contribution(v, "beat noise, flight in") == pytest.approx(1e-8, rel=1e-9)
    # docs/physics.md: the wavelength moves with -0.95 ppm/K of the index, +0.268 ppm/hPa, -0.0085 ppm a percent
    assert contribution(v, "air temperature") == pytest.approx(0.265 * 0.95e-6 * 0.2, rel=0.01)
    assert contribution(v, "air pressure") == pytest.approx(0.265 * 0.268e-6, rel=0.01)
    assert contribution(v, "air humidity") == pytest.approx(0.265 * 0.0085e-6 * 5.0, rel=0.03)
    assert v.std == pytest.approx(math.hypot(v.std_a, v.std_b)) and v.expanded == 2 * v.std
    assert v.std_a == pytest.approx(1e-8)


def test_wavelength_as_printed_is_rounded() -> None:
    v = of(shot_of(), "velocity_in_m_per_s")
    assert contribution(v, "wavelength in air") == pytest.approx(0.265 * 0.05 / 632.8 / math.sqrt(3), rel=1e-9)
    finer = replace(LASER, wavelength_vacuum_m=None, wavelength_air_m=632.8196e-9)
    v = of(shot_of(setup=finer), "velocity_in_m_per_s")
    assert contribution(v, "wavelength in air") == pytest.approx(0.265 * 0.00005 / 632.8196 / math.sqrt(3), rel=1e-6)


def test_common_scales_cancel_from_restitution() -> None:
    cor = of(shot_of(setup=LASER), "cor_quasi_static")
    assert cor.std_b == 0.0
    assert cor.std == pytest.approx(0.987556 * math.hypot(1e-8 / 0.265, 1e-8 / 0.2617), rel=1e-3)
    assert {row.source for row in cor.rows} >= {
        "timebase",
        "alignment (cosine)",
        "wavelength in vacuum",
        "repeatability",
    }


def test_budget_against_a_monte_carlo_of_the_measurement() -> None:
    """Draw every input, redo the measurement equations by hand, compare (GUM supplement 1)."""
    motion = motion_of(Synthetic())
    shot = shot_of(setup=LASER, motion=replace(motion, moving_mass_u_kg=2e-6, rest_frequency_hz=Quantity(2.7e6, 0.0)))
    known = InstrumentUncertainty(
        wavelength_vacuum_relative=2e-5, timebase_limit=1e-4, alignment_limit_rad=2e-2, rest_frequency_u_hz=40.0
    )
    tables = budget(shot, known)
    rng, n = np.random.default_rng(11), 40_000
    rest = 0.5 * 632.8e-9 * rng.normal(0.0, 40.0, n)
    tick = rng.uniform(1 - 1e-4, 1 + 1e-4, n)
    air = Quantity(1.0, math.sqrt((0.95e-6 * 0.2) ** 2 + 0.268e-6**2 + (0.0085e-6 * 5) ** 2))
    length = rng.normal(1.0, 2e-5, n) * rng.normal(1.0, air.std, n)
    length = length * rng.normal(1.0, 0.5 * 4e-4 / math.sqrt(3), n)  # the cosine's mean counted in its uncertainty
    mass = rng.normal(1.0, 2e-6 / 17.85e-3, n)
    into = (rng.normal(-0.265, 1e-8, n) + rest) * length / tick
    out = (rng.normal(0.261702343, 1e-8, n) + rest) * length / tick
    force_noise = math.sqrt(1e-4**2 - (0.511915 * 2e-6 / 17.85e-3) ** 2)  # the reading carries the mass already
    force = rng.normal(0.511915, force_noise, n) * mass * length / tick**2
    stiffness = rng.normal(221.4, 0.002, n) * mass / tick**2
    for key, drawn in (
        ("velocity_in_m_per_s", into),
        ("velocity_out_m_per_s", out),
        ("cor_quasi_static", -out / into),
        ("force_peak_n", force),
        ("plate_stiffness_n_per_m", stiffness),
    ):
        found = tables.of(key)
        assert found is not None
        assert found.std == pytest.approx(float(np.std(drawn)), rel=0.02), key
        assert found.value == pytest.approx(float(np.mean(drawn)), abs=4 * found.std / math.sqrt(n) + 1e-3 * found.std)


def test_rest_frequency_given_and_measured() -> None:
    motion = motion_of(Synthetic())
    given = of(shot_of(motion=motion), "velocity_in_m_per_s", rest_frequency_u_hz=50.0)
    row = next(row for row in given.rows if row.source == "rest frequency")
    assert row.kind == "B" and row.contribution == pytest.approx(0.5 * 632.8e-9 * 50.0, rel=1e-3)
    cor = of(shot_of(motion=motion), "cor_quasi_static", rest_frequency_u_hz=50.0)
    # the same velocity added to both flights: (v_in - v_out) / v_in^2
    expected = 0.5 * 632.8e-9 * 50.0 * (0.265 + 0.261702) / 0.265**2
    assert contribution(cor, "rest frequency") == pytest.approx(expected, rel=1e-3)


def test_a_slope_is_sheared_by_an_error_of_the_rest_frequency() -> None:
    """It lets the deflection grow by the same velocity all the time, here over half a sine, refitted."""
    impact = paper_impact()
    contact, deepest = impact.contact_time_s, impact.deflection_max_m
    assert isinstance(contact, Quantity) and isinstance(deepest, Quantity)
    at = np.linspace(*SLOPE_SPAN, 500)
    force = deepest.value * np.sin(np.pi * at)  # at 1 N/m
    velocity = 0.5 * 632.8e-9 * 50.0
    (sheared, _) = np.polyfit(force - velocity * contact.value * at, force, 1)
    slope = of(shot_of(motion=motion_of(Synthetic())), "stiffness_slope_n_per_m", rest_frequency_u_hz=50.0)
    assert contribution(slope, "rest frequency") == pytest.approx(slope.value * abs(sheared - 1.0), rel=0.01)


def test_kinetic_cor_includes_the_shift_by_the_band_limit() -> None:
    for key, std in (("force_peaks", 1e-3), ("onsets", 1e-3), ("flights", 2e-3)):
        q = of(shot_of(), f"cor_kinetic.{key}", instant_limit_s=2e-6)
        assert q.std_a == pytest.approx(std, rel=1e-3)
        assert q.std_b > 0.0 and "bandwidth, T1" in {row.source for row in q.rows}
    first, second = 1.56573968e-3, 2.34904083e-3 - 1.56573968e-3
    expected = 2e-6 / math.sqrt(3) * math.hypot(1 / first, second / first**2)
    assert of(shot_of(), "cor_kinetic.onsets", instant_limit_s=2e-6).std_b == pytest.approx(expected, rel=1e-6)


def test_a_peak_is_as_uncertain_as_what_the_band_limit_may_take_from_it() -> None:
    """A pulse of duration T loses up to (1 / (2 T B))^2 of its height; a band twice as wide loses a quarter of that."""
    motion = motion_of(Synthetic())
    contact, peak = paper_impact().contact_time_s, paper_impact().force_peak_n
    assert isinstance(contact, Quantity) and isinstance(peak, Quantity)
    limit = peak.value * (0.5 / (contact.value * motion.bandwidth_hz)) ** 2
    for wider in (1.0, 2.0):
        force = of(shot_of(motion=replace(motion, bandwidth_hz=wider * motion.bandwidth_hz)), "force_peak_n")
        assert contribution(force, "bandwidth") == pytest.approx(limit / wider**2 / math.sqrt(3), rel=1e-9)


def test_what_was_not_measured_is_uncertain_by_what_a_room_and_a_balance_leave_open() -> None:
    shot = shot_of(setup=replace(LASER, air=None, moving_mass_u_kg=0.0))
    v = of(shot, "velocity_in_m_per_s")
    assert contribution(v, "air temperature") == pytest.approx(0.265 * 0.95e-6 * 2.0, rel=0.02)
    assert contribution(v, "air pressure") == pytest.approx(0.265 * 0.268e-8 * 1500.0, rel=0.02)
    assert contribution(v, "air humidity") == pytest.approx(0.265 * 0.0085e-6 * 15.0, rel=0.05)
    force = of(shot, "force_peak_n")  # weighed to 0.01 g: half of that either way
    assert contribution(force, "mass") == pytest.approx(force.value * 0.005e-3 / math.sqrt(3) / 17.85e-3, rel=1e-9)


def test_stiffness_depends_on_mass_and_clock_but_not_on_the_wavelength() -> None:
    k = of(shot_of(setup=LASER), "plate_stiffness_n_per_m", wavelength_vacuum_relative=1e-3)
    expected = 221.4 * math.hypot(2e-6 / 17.85e-3, 2 * 25e-6 / math.sqrt(3))
    assert k.std_b == pytest.approx(expected, rel=1e-6)
    corrected = of(shot_of(setup=LASER), "stiffness_from_slope_n_per_m")
    assert corrected.value == pytest.approx(221.4, abs=0.01)
    assert contribution(corrected, "mass") == pytest.approx(221.4 * 2e-6 / 17.85e-3, rel=1e-3)


def test_modulus_includes_the_plates_tolerances() -> None:
    modulus = of(shot_of(setup=LASER), "youngs_modulus_pa")
    assert LASER.plate is not None
    k = of(shot_of(setup=LASER), "plate_stiffness_n_per_m")
    whole = modulus_pa(k.quantity, LASER.plate, PlateTolerance())
    assert modulus.value == pytest.approx(whole.value, rel=1e-12)
    assert modulus.std == pytest.approx(whole.std, rel=1e-9)
    assert modulus.rows[0].source == "plate: thickness"


def test_repeatability_is_the_scatter_of_similar_shots_beyond_their_noise() -> None:
    rng = np.random.default_rng(2)
    shots = [at_speed(f"s{i}", 0.26, 0.9876 + rng.normal(0, 1e-4), 1e-6) for i in range(40)]
    far = at_speed("far", 0.5, 0.7, 1e-6)
    cor = budget(shots[0], others=[*shots, far]).of("cor_quasi_static")
    assert cor is not None
    row = next(row for row in cor.rows if row.source == "repeatability")
    assert row.std == pytest.approx(1e-4, rel=0.35) and "40 shots" in row.how
    assert cor.std_a > row.contribution
    alone = budget(shots[0], others=[far]).of("cor_quasi_static")
    assert alone is not None
    row = next(row for row in alone.rows if row.source == "repeatability")
    assert row.std is None and row.contribution == 0.0


def test_a_trend_over_speed_is_no_scatter() -> None:
    speeds = np.linspace(0.25, 0.27, 6)
    shots = [at_speed(f"s{i}", v, 0.99 - 0.5 * v, 1e-6) for i, v in enumerate(speeds)]
    cor = budget(shots[3], others=shots).of("cor_quasi_static")
    assert cor is not None
    row = next(row for row in cor.rows if row.source == "repeatability")
    assert row.std == 0.0 and "line over speed" in row.how
    fewer = budget(shots[0], others=[shots[5]]).of("cor_quasi_static")
    assert fewer is not None  # two shots cannot tell a line from scatter
    assert next(row for row in fewer.rows if row.source == "repeatability").contribution > 1e-3


def test_a_motion_record_brings_its_own_length() -> None:
    """What another instrument measured has no wavelength and no beam to align."""
    record = shot_of(setup=None, motion=replace(motion_of(Synthetic()), wavelength_m=None))
    velocity = of(record, "velocity_in_m_per_s")
    assert {row.source for row in velocity.rows} == {"beat noise, flight in", "timebase"}
    stated = replace(record, setup=LASER)  # whatever a file beside it says of a laser
    assert {row.source for row in of(stated, "velocity_in_m_per_s").rows} == {"beat noise, flight in", "timebase"}


def test_a_shot_that_shows_little_has_a_short_budget() -> None:
    nothing = shot_of(impact=None, fit=None, setup=None)
    assert budget(nothing).quantities == ()
    impact = shot_of().impact
    assert impact is not None
    half = shot_of(impact=replace(impact, velocity_out_m_per_s=NotSeen("no release")), fit=None)
    keys = {q.key for q in budget(half).quantities}
    assert "velocity_in_m_per_s" in keys and "cor_quasi_static" not in keys and "plate_stiffness_n_per_m" not in keys


def test_result_and_rows() -> None:
    found = budget(shot_of(setup=LASER))
    written = json.loads(json.dumps(table.budget_result(found), allow_nan=False))
    velocity = written["quantities"]["velocity_in_m_per_s"]
    assert velocity["expanded"] == pytest.approx(2 * math.hypot(velocity["std_a"], velocity["std_b"]))
    assert sum(s["contribution"] ** 2 for s in velocity["sources"]) == pytest.approx(velocity["std"] ** 2)
    rows = table.budget_rows(found)
    assert all(len(row) == len(table.COLUMNS) for row in rows)
    assert sum(row[4].startswith("expanded") for row in rows) == len(found.quantities)


def test_the_air_used_is_the_air_of_the_analysis() -> None:
    """The budget's wavelength must be the one the velocities were made with."""
    assert wavelength_in_air_m(LASER) == pytest.approx(632.820e-9, abs=1e-12)


@pytest.mark.parametrize("wrong", [{"timebase_limit": -1e-6}, {"mass_u_kg": math.nan}])
def test_an_impossible_uncertainty_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        InstrumentUncertainty(**wrong)  # type: ignore[arg-type]


def test_a_rest_frequency_that_was_measured_moves_both_velocities_by_one_amount() -> None:
    """40 Hz by PD0 beside all else that is small: 13 um/s in either velocity, and nearly twice that in their ratio."""
    beat = BeatQuality(2.7e6, 0.4, 40.0, 0.0)
    motion = replace(motion_of(Synthetic()), reference=beat, rest_frequency_hz=Quantity(2.7e6, 40.0))
    found = budget(shot_of(setup=LASER, motion=motion), InstrumentUncertainty())
    moved = 0.5 * 632.8e-9 * 40.0
    for key, share in (
        ("velocity_in_m_per_s", 1.0),
        ("velocity_out_m_per_s", 1.0),
        ("cor_quasi_static", (1.0 + 0.987556) / 0.265),
    ):
        table_of_one = found.of(key)
        assert table_of_one is not None
        assert contribution(table_of_one, "rest frequency") == pytest.approx(share * moved, rel=1e-3)
        assert table_of_one.std_a == pytest.approx(share * moved, rel=0.01)


@pytest.mark.parametrize("key", ["velocity_in_m_per_s", "velocity_out_m_per_s", "force_peak_n", "contact_time_s"])
@pytest.mark.parametrize(("value", "std"), [(math.nan, 1e-8), (0.3, math.nan), (0.3, math.inf)])
def test_a_number_that_is_none_has_no_budget_and_spoils_no_other(key: str, value: float, std: float) -> None:
    sound = shot_of(setup=LASER)
    assert sound.impact is not None
    spoilt = replace(sound, impact=replace(sound.impact, **{key: Quantity(value, std)}))
    found = budget(spoilt)
    assert found.of(key) is None
    for quantity in found.quantities:
        assert math.isfinite(quantity.std_a) and math.isfinite(quantity.std_b), quantity.words


@pytest.mark.parametrize("how", ["force_peaks", "onsets", "flights"])
def test_bounces_after_the_third_change_nothing_of_what_the_first_ones_say(how: str) -> None:
    three = shot_of(setup=LASER)
    impact = three.impact
    assert impact is not None and len(impact.bounce_onsets_s) == 3
    more = {
        name: (*times, times[-1] + 4e-3, times[-1] + 5e-3)
        for name in ("bounce_onsets_s", "bounce_releases_s", "bounce_peaks_s")
        if (times := getattr(impact, name))
    }
    five = replace(three, impact=replace(impact, **more))
    one, other = (of(shot, f"cor_kinetic.{how}") for shot in (three, five))
    assert [(row.source, row.contribution) for row in one.rows] == [
        (row.source, row.contribution) for row in other.rows
    ]
