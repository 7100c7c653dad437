"""The numbers of a shot against the reference solution of docs/physics.md, "the model"."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.reading.edges import Edge
from analysis.reading.flight import fit_flight
from analysis.reading.floor_spectrum import FloorSpectrum, Octaves
from analysis.reading.locate import find_collision
from analysis.reading.pulse import read_deflection, read_slope
from analysis.reading.read import NoImpact, read_impact
from analysis.reading.record_checks import describe_motion
from analysis.shot.impact import Impact
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen, Quantity, Reading
from tests.analysis.synthetic_collision import Synthetic, motion_from, motion_of, position_m, true_of

RIG = Synthetic()
CONTACT_S = 28.70771255e-3


def still(motion: Motion) -> FloorSpectrum:
    """Return a floor that does not move under a motion of 0.1 nm of white noise."""
    each = max(1, round(0.5e-3 * motion.sample_rate_hz))
    octaves = Octaves.of(motion.time_s[::each], each / motion.sample_rate_hz)
    return FloorSpectrum(octaves, np.zeros(octaves.centre_hz.size), RIG.noise_m, motion.sample_rate_hz)


def seen(reading: Reading) -> Quantity:
    assert isinstance(reading, Quantity), reading
    return reading


@pytest.fixture(scope="module")
def motion() -> Motion:
    return motion_of(RIG)


@pytest.fixture(scope="module")
def impact(motion: Motion) -> Impact:
    return read_impact(motion)


# value of docs/physics.md, and how far the reading may lie from it (the stated figure where there is one)
TABLE = [
    ("velocity_in_m_per_s", -0.265, 3e-6),
    ("velocity_out_m_per_s", 0.261702343, 3e-6),
    ("cor_quasi_static", 0.987556, 2e-5),
    ("force_peak_n", 0.511915, 0.004),
    ("contact_time_s", 28.70771255e-3, 1e-4),
    ("deflection_max_m", 2.388512e-3, 5e-6),
    ("stiffness_slope_n_per_m", 214.33, 1.5),
    ("force_fwhm_s", 19.1e-3, 0.2e-3),
]


@pytest.mark.parametrize(("name", "value", "within"), TABLE)
def test_reference_solution(impact: Impact, name: str, value: float, within: float) -> None:
    reading = seen(getattr(impact, name))
    assert reading.value == pytest.approx(value, abs=within)
    assert 0.0 < reading.std < within


def test_bounces(impact: Impact) -> None:
    kinetic = impact.cor_kinetic
    for reading, value in ((kinetic.force_peaks, 0.563), (kinetic.onsets, 0.500), (kinetic.flights, 0.168)):
        assert abs(seen(reading).value - value) < 4.0 * seen(reading).std
        assert seen(reading).std < 0.02
    onsets = np.array(impact.bounce_onsets_s) - RIG.touch_s
    assert onsets == pytest.approx([0.0, 1.56573968e-3, 2.34904083e-3], abs=25e-6)
    peaks = np.array(impact.bounce_peaks_s) - RIG.touch_s
    assert peaks == pytest.approx([0.16220e-3, 1.77080e-3, 2.67670e-3], abs=6e-6)


def test_both_restitutions_agree(impact: Impact) -> None:
    quasi_static, impulse = seen(impact.cor_quasi_static), seen(impact.cor_impulse)
    assert abs(quasi_static.value - impulse.value) < 3.0 * np.hypot(quasi_static.std, impulse.std)
    assert impact.flags == ()


def test_stated_uncertainty_of_the_restitution_is_true() -> None:
    values, stds = [], []
    for seed in range(30):
        reading = seen(read_impact(motion_of(RIG, seed)).cor_quasi_static)
        values.append(reading.value)
        stds.append(reading.std)
    # 29 degrees of freedom: within 0.74 to 1.26 in 95 of 100 draws, within 0.6 to 1.5 practically always
    assert 0.6 < np.std(values, ddof=1) / np.mean(stds) < 1.5


@pytest.mark.parametrize("speed", [0.05, 0.15, 0.6])
def test_speeds(speed: float) -> None:
    impact = read_impact(motion_of(Synthetic(speed_m_per_s=speed)))
    assert seen(impact.velocity_in_m_per_s).value == pytest.approx(-speed, rel=1e-5)
    # the model is linear: restitution and times do not depend on the speed
    assert seen(impact.cor_quasi_static).value == pytest.approx(0.987556, abs=2e-5)
    assert abs(seen(impact.cor_kinetic.force_peaks).value - 0.563) < 0.02


def test_drag_bends_the_flights_but_not_the_reading() -> None:
    drag = 1e-3
    impact = read_impact(motion_of(Synthetic(drag_n_s_per_m=drag)))
    # the velocity is that at the touch, not the flight's mean: with this drag the two differ by 7e-5 m/s
    assert seen(impact.velocity_in_m_per_s).value == pytest.approx(-0.265, abs=3e-6)
    assert abs(seen(impact.cor_kinetic.force_peaks).value - 0.563) < 0.01
    assert "impulse_disagrees" not in impact.flags


def test_noise_only_is_no_impact() -> None:
    time = np.arange(0.0, 0.06, 1e-5)
    x = np.random.default_rng(0).normal(0.0, 1e-10, time.size) - 0.2 * time
    with pytest.raises(NoImpact, match="never rises"):
        read_impact(motion_from(time, x, RIG))


@pytest.mark.parametrize(
    ("speed", "said"),
    [
        (-0.2, "comes to the plate throughout, at 0.2 m/s: the record ends"),
        (0.2, "leaves the plate throughout, at 0.2 m/s: the switch triggered on its way back"),
        (0.0, "stands still throughout"),
    ],
)
def test_of_a_record_without_a_collision_it_is_said_where_the_block_went(speed: float, said: str) -> None:
    time = np.arange(0.0, 0.06, 1e-5)
    shaken = 1e-6 * np.sin(2.0 * np.pi * 24.7 * time)  # by a building
    x = np.random.default_rng(0).normal(0.0, 1e-10, time.size) + speed * time + shaken
    assert said in describe_motion(motion_from(time, x, RIG))


def test_of_a_block_that_a_hand_turns_round_and_of_another_instrument_no_way_is_told() -> None:
    time = np.arange(0.0, 0.06, 1e-5)
    turned = np.random.default_rng(0).normal(0.0, 1e-10, time.size) + 0.002 * np.sin(2.0 * np.pi * 5.0 * time)
    assert describe_motion(motion_from(time, turned, RIG)) == ""
    assert describe_motion(replace(motion_from(time, 0.2 * time, RIG), wavelength_m=None)) == ""


def test_a_record_that_starts_inside_the_contact_is_refused(motion: Motion) -> None:
    late = motion.time_s > RIG.touch_s + 2e-3
    with pytest.raises(NoImpact):
        read_impact(motion_from(motion.time_s[late].copy(), motion.displacement_m[late].copy(), RIG))


def test_a_record_that_ends_inside_the_contact_keeps_what_was_seen(motion: Motion) -> None:
    early = motion.time_s < RIG.touch_s + 20e-3
    impact = read_impact(motion_from(motion.time_s[early].copy(), motion.displacement_m[early].copy(), RIG))
    assert seen(impact.velocity_in_m_per_s).value == pytest.approx(-0.265, abs=3e-6)
    assert isinstance(impact.velocity_out_m_per_s, NotSeen)
    assert "no_release" in impact.flags


@pytest.mark.parametrize("before_s", [1e-3, 10e-3])
@pytest.mark.parametrize("after_s", [3.5e-3, 5e-3, 20e-3])
def test_a_contact_is_found_alike_however_little_flight_the_record_has_about_it(
    motion: Motion, before_s: float, after_s: float
) -> None:
    """Where nearly all of the record is contact, its own force is not taken for the noise that it must exceed."""
    kept = np.abs(motion.time_s - RIG.touch_s - 0.5 * (CONTACT_S + after_s - before_s)) < 0.5 * (
        before_s + CONTACT_S + after_s
    )
    short = motion_from(motion.time_s[kept].copy(), motion.displacement_m[kept].copy(), RIG)
    span = find_collision(short)
    assert span is not None and span.finished
    assert short.time_s[span.first] == pytest.approx(RIG.touch_s, abs=0.3e-3)
    assert short.time_s[span.last] == pytest.approx(RIG.touch_s + CONTACT_S, abs=0.3e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_release_is_as_sure_in_a_record_that_ends_soon_after_it_as_in_a_longer_one(seed: int) -> None:
    """The force is compared with its noise in flight: the last of the contact is no part of that, however near."""
    noisy = Synthetic(noise_m=1e-9)
    whole = motion_of(noisy, seed)
    stds = []
    for after_s in (3.5e-3, 20e-3):
        kept = whole.time_s < noisy.touch_s + CONTACT_S + after_s
        short = motion_from(whole.time_s[kept].copy(), whole.displacement_m[kept].copy(), noisy)
        release = seen(read_impact(short).release_time_s)
        assert abs(release.value - noisy.touch_s - CONTACT_S) < 4.0 * release.std
        stds.append(release.std)
    assert stds[0] < 1.5 * stds[1]


def test_a_velocity_says_how_many_samples_of_flight_it_was_read_from(motion: Motion, impact: Impact) -> None:
    """The record begins in flight, and the touch is known to less than a sample: they are all those before it."""
    assert seen(impact.touch_time_s).std < 0.2 / motion.sample_rate_hz
    how = seen(impact.velocity_in_m_per_s).how
    assert f" {np.count_nonzero(motion.time_s < RIG.touch_s)} samples of free flight" in how


def test_a_turn_with_one_sample_missing_is_still_read_and_with_two_it_is_not() -> None:
    """Of a slow record five samples lie about the turn; three would be a parabola that nothing checks."""
    slow = Synthetic(rate_hz=5e3, bandwidth_hz=1e3)
    whole = motion_of(slow)
    fine_s = np.linspace(slow.touch_s, slow.touch_s + CONTACT_S, 100_001)
    turn_s = float(fine_s[position_m(slow, fine_s).argmin()])
    (nearest, second, *_) = np.argsort(np.abs(whole.time_s - turn_s))
    touch = Edge(slow.touch_s, 1e-7)
    for missing, read in (((nearest,), True), ((nearest, second), False)):
        x = whole.displacement_m.copy()
        x[list(missing)] = np.nan
        found = read_deflection(motion_from(whole.time_s, x, slow), turn_s, touch, -slow.speed_m_per_s, still(whole))
        assert isinstance(found, Quantity) is read
        if isinstance(found, Quantity):
            assert found.value == pytest.approx(true_of(slow)["deflection_max_m"], abs=1e-6)


def test_a_hole_in_the_contact_is_said_not_bridged(motion: Motion) -> None:
    x = motion.displacement_m.copy()
    x[(motion.time_s > RIG.touch_s + 10e-3) & (motion.time_s < RIG.touch_s + 12e-3)] = np.nan
    impact = read_impact(motion_from(motion.time_s.copy(), x, RIG))
    assert seen(impact.cor_quasi_static).value == pytest.approx(0.987556, abs=2e-5)
    assert isinstance(impact.cor_impulse, NotSeen)


def test_a_contact_below_the_force_noise_is_found_by_its_reversal() -> None:
    """A motion capture at 500 Hz: its second derivative drowns a contact that its displacement shows plainly."""
    rig = Synthetic(rate_hz=500.0, bandwidth_hz=100.0, noise_m=40e-6)
    time = np.arange(0.0, 4.0, 1.0 / rig.rate_hz)
    duration, speed = 0.05, 0.16
    u = time - 2.0
    x = np.where(
        u < 0.0, -speed * u, np.where(u < duration, -speed * duration / np.pi * np.sin(np.pi * u / duration), 0)
    )
    x = np.where(u >= duration, speed * (u - duration), x) + np.random.default_rng(3).normal(
        0.0, rig.noise_m, time.size
    )
    impact = read_impact(motion_from(time, x, rig))
    assert abs(seen(impact.velocity_in_m_per_s).value + speed) < 4.0 * seen(impact.velocity_in_m_per_s).std
    assert abs(seen(impact.cor_quasi_static).value - 1.0) < 4.0 * seen(impact.cor_quasi_static).std
    assert seen(impact.contact_time_s).value == pytest.approx(duration, abs=4e-3)


def test_the_slope_says_what_a_badly_known_end_of_the_contact_costs() -> None:
    motion = motion_of(RIG)
    span = find_collision(motion)
    assert span is not None
    flight = fit_flight(motion, span.flight_first, span.first - 4, nearest=span.first)
    assert flight is not None
    noise = still(motion)
    touch, end_s = Edge(RIG.touch_s, 1e-6), RIG.touch_s + 28.7e-3
    sure = seen(read_slope(motion, touch, Edge(end_s, 1e-6), flight, noise))
    late = seen(read_slope(motion, touch, Edge(end_s + 2e-3, 2e-3), flight, noise))
    assert abs(late.value - sure.value) > 5.0 * sure.std  # samples without a force are among those it was read from
    assert abs(late.value - sure.value) < 2.0 * late.std

    held = replace(motion, displacement_m=np.where(motion.time_s > RIG.touch_s, -1e-3, motion.displacement_m))
    resting = read_slope(held, touch, Edge(end_s, 1e-6), flight, noise)  # counted in steps of a millimetre
    assert isinstance(resting, NotSeen) and "the same" in resting.reason


def any_motion(random: np.random.Generator) -> Motion:
    """Return a motion of any rate, noise and shape: wanders, pushes, bounces, swings, holes."""
    rate_hz, samples, speed = 10 ** random.uniform(2.5, 5.0), int(random.integers(64, 4000)), random.uniform(0.05, 0.4)
    time = np.arange(samples) / rate_hz
    lasts = samples / rate_hz
    pushes = np.zeros(samples)
    for begin, end in np.sort(random.integers(0, samples, (3, 2)), axis=1):
        push = random.uniform(-1.0, 2.0) * np.sin(np.linspace(0.0, np.pi, max(end - begin, 2)))
        pushes[begin : begin + push.size] += push[: samples - begin]
    scale = 2.0 * speed * rate_hz / max(abs(float(pushes.sum())), 1e-9)
    shapes = (
        1e-6 / samples * np.cumsum(np.cumsum(random.standard_normal(samples))),
        -speed * time + scale * np.cumsum(np.cumsum(pushes)) / rate_hz**2,
        speed * np.abs(time - lasts * random.uniform(0.2, 0.8)),
        speed * lasts * np.cos(2 * np.pi * random.uniform(0.5, 6.0) * time / lasts),
    )
    noise_m = 10 ** random.uniform(-11.0, -3.0)
    x = shapes[random.integers(4)] + noise_m * random.standard_normal(samples)
    if random.uniform() < 0.2:
        x[random.integers(0, samples, samples // 50 + 1)] = np.nan
    rig = Synthetic(rate_hz=rate_hz, bandwidth_hz=rate_hz * random.uniform(0.02, 0.2), noise_m=noise_m)
    return motion_from(time, x, rig)


def test_any_motion_is_read_or_refused_in_words() -> None:
    ends = set()
    for seed in range(400):
        try:
            ends.add(type(read_impact(any_motion(np.random.default_rng(seed))).release_time_s))
        except NoImpact as refused:
            assert str(refused)
            ends.add(NoImpact)
    assert ends == {Quantity, NotSeen, NoImpact}
