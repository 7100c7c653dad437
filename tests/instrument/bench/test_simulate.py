"""Recordings of the simulated rig: readable, reproducible, the truth hidden; effects act in the right direction."""

import base64
import json

import numpy as np
import pytest

from instrument.bench import forces as slot
from instrument.bench.effects import (
    CATALOGUE,
    OFF_CATALOGUE,
    complete,
    draw,
    effects_of_shot,
    force_slots,
    parse,
)
from instrument.bench.measured_path import measured_path, simulate_collision, with_cyclic_error
from instrument.bench.mechanics import Bodies
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import (
    FASTEST_M_PER_S,
    SLOWEST_M_PER_S,
    draw_undeclared,
    record_shot,
    simulate,
    speeds_of_set,
)
from instrument.bench.site import site_named
from instrument.files.recording_file import data_hash, read_recording
from instrument.files.recording_search import find_recordings
from tests.bench.displacement_noise import cyclic_m
from tests.bench.plate import plate_m
from tests.bench.scaled import scaled

SPEED = 0.265
TIME = np.arange(0.0, 0.06, 1e-5)


def _run(text="", speed=SPEED, distance=3e-3):
    effects = parse(text) if text else {}
    return simulate_collision(-speed, effects, Bodies(), distance, 0.0601), effects


@pytest.fixture(scope="module")
def base():
    return _run()[0]


def test_a_set_is_written_and_read_back(tmp_path):
    paths = simulate(tmp_path, 2, 7, {"coulomb_friction": {"force_n": 5e-5}})
    assert find_recordings([tmp_path]) == paths
    assert all(data_hash(path).agrees for path in paths)
    shots = [read_recording(path) for path in paths]
    assert [shot.name for shot in shots] == ["shot-1", "shot-2"]
    for shot, speed in zip(shots, speeds_of_set(2, 7), strict=True):
        assert shot.samples == 600_000 and shot.flags == ()
        assert "coulomb_friction force_n = 5e-05" in shot.note
        level = shot.counts[:, 2].astype(float)
        crossing = shot.trigger_sample
        assert level[crossing - 1200 : crossing - 1000].mean() == pytest.approx(100, abs=3)
        assert level[crossing + 1000 : crossing + 1200].mean() == pytest.approx(1800, abs=3)
        assert crossing / shot.sample_rate_hz == pytest.approx(0.012 - 0.7e-3 / speed, rel=0.03)


def test_the_speeds_of_a_set_scatter_to_both_sides_of_even_steps_and_no_two_sets_share_them():
    """Speeds at exact steps, or all off to one side, would hide what depends on the speed."""
    sets = np.array([speeds_of_set(5, seed) for seed in range(40)])
    even = np.linspace(SLOWEST_M_PER_S, FASTEST_M_PER_S, 5)
    assert np.all(np.diff(sets, axis=1) > 0) and np.unique(sets).size == sets.size
    assert np.all((sets < even).any(axis=0) & (sets > even).any(axis=0))
    assert sets.mean(axis=0) == pytest.approx(even, abs=4e-3)  # 40 draws within 9 mm/s: 0.8 mm/s


@pytest.mark.parametrize(("beat_v", "flags"), [(0.9, ()), (1.1, ("clipped",))])
def test_a_beat_beyond_the_range_of_the_digitizer_is_flagged(beat_v, flags):
    rig = Bench(optics=Optics(measurement_v=beat_v))
    recording, truth = record_shot(rig, 2, 0.3, 10e6, 0.015)
    assert (recording.flags, recording.name, recording.setup, truth) == (flags, "shot-3", rig.setup, {})
    assert recording.started_at == "2026-01-01T09:01:02Z"  # a minute a seed, a second a shot
    assert recording.counts.shape == (150_000, 3) and recording.channels == rig.optics.channels


def test_one_seed_is_one_set(tmp_path):
    one, same, other = (simulate(tmp_path / name, 1, seed) for name, seed in (("a", 3), ("b", 3), ("c", 4)))
    counts = [read_recording(paths[0]).counts for paths in (one, same, other)]
    assert np.array_equal(counts[0], counts[1]) and not np.array_equal(counts[0], counts[2])


def test_what_is_undeclared_is_told_only_in_the_hidden_file(tmp_path):
    seed = next(s for s in range(100) if len(draw_undeclared(s)) == 1)
    paths = simulate(tmp_path, 2, seed, undeclared=True)
    name = next(iter(draw_undeclared(seed)))
    truth = json.loads(base64.b64decode((tmp_path / f".truth-{seed}").read_bytes()))["shots"]
    assert [list(shot) for shot in truth] == [[name], [name]]
    assert find_recordings([tmp_path]) == paths
    told = "".join(path.read_text() for path in paths)
    assert name not in told and not any(key in told for key in truth[0][name] if key != "mass_kg")
    assert json.loads(paths[0].read_text())["annotations"] == []
    assert name.encode() not in (tmp_path / f".truth-{seed}").read_bytes()


def test_undeclared_draws_all_kinds():
    drawn = [draw_undeclared(seed) for seed in range(400)]
    kinds = [len(d) for d in drawn]
    assert {0, 1, 2} == set(kinds)
    assert {name for d in drawn for name in d} == set(CATALOGUE) | set(OFF_CATALOGUE)
    shares = [np.random.default_rng((seed, 0xD)).random() for seed in range(400)]
    assert [len(d) for d in drawn] == [2 if 0.6 <= share < 0.7 else int(share < 0.85) for share in shares]
    with pytest.raises(ValueError, match="drawn from the seed"):
        simulate("nowhere", 1, 1, {"tilt": {}}, True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colomb_friction:force_n=1", "no effect is called 'colomb_friction'"),
        ("tilt:angle=1", "no parameter 'angle'; it has angle_rad"),
        ("tilt:angle_rad=x", "not a number"),
        ("tilt:angle_rad", "not PARAMETER=VALUE"),
        ("viscous_drag:coefficient_n_s_per_m=-1", "not possible"),
        ("cyclic_error:order=1.5", "order"),
        ("block_mode:frequency_hz=0", "above zero"),
        ("", "no effect is named"),
    ],
)
def test_a_wrong_effect_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError, match=message) as refused:
        parse(text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "key", "good", "bad"),
    [
        ("tilt", "angle_rad", (-9.0, 0.0, 9.0), (np.inf, np.nan)),
        ("viscous_drag", "coefficient_n_s_per_m", (0.0, 9.0), (-1e-9, np.inf)),
        ("cyclic_error", "order", (1, 2, 3, 4), (0, 5, 1.5)),
        ("frame_vibration_with_plate", "plate_factor", (0.0, 1.0), (1.001, -0.1)),
        *(
            (name, key, (1e-12,), (0.0, -1.0))
            for name, key in (
                *(("block_mode", "frequency_hz"), ("viscoelastic_arm", "relaxation_time_s"), ("adhesion", "range_m")),
                *(("contact_area", "overlap_m"), ("bristle_friction", "deflection_m"), ("magnet", "range_m")),
            )
        ),
    ],
)
def test_a_parameter_is_simulated_up_to_its_limits(name, key, good, bad):
    for value in good:
        assert complete({name: {key: value}})[name][key] == value
    for value in bad:
        with pytest.raises(ValueError, match=name):
            complete({name: {key: value}})


def test_a_second_mode_without_mass_is_none_and_several_effects_are_parted_by_semicolons():
    mode = complete({"second_plate_mode": {"mass_kg": 0.0}})
    still, without = (simulate_collision(-SPEED, effects, Bodies(), 2e-3, 0.03) for effects in (mode, {}))
    assert plate_m(still, TIME[:2000]) == pytest.approx(plate_m(without, TIME[:2000]), abs=1e-9)
    assert force_slots(complete({"second_plate_mode": {"mass_kg": 1e-9}}))[slot.M_MODE] == 1e-9
    many = parse(" tilt : angle_rad = 1e-4 , ;; coulomb_friction;viscous_drag:")
    assert list(many) == ["tilt", "coulomb_friction", "viscous_drag"] and many["tilt"] == {"angle_rad": 1e-4}
    assert many["coulomb_friction"]["force_n"] == pytest.approx(np.sqrt(1e-5 * 3e-4))


def test_effects_are_read_as_written():
    effects = parse("tilt:angle_rad=-2e-4; block_mode:mass_kg=1e-3,frequency_hz=800,damping_ratio=0.01")
    assert effects["tilt"] == {"angle_rad": -2e-4}
    assert effects["block_mode"] == {"mass_kg": 1e-3, "frequency_hz": 800.0, "damping_ratio": 0.01}


@pytest.mark.parametrize("name", [*CATALOGUE, *OFF_CATALOGUE])
def test_every_effect_moves_what_is_seen_and_vanishes_with_its_strength(name, base):
    effects = {name: draw(name, np.random.default_rng(1))}
    optics = Optics()

    def change(strength):
        now = scaled(effects, strength)
        x, _ = measured_path(simulate_collision(-SPEED, now, Bodies(), 3e-3, 0.0601), now, TIME)
        x = x + cyclic_m(with_cyclic_error(optics, now), x)
        return np.sqrt(np.mean((x - base.block_m(TIME)) ** 2))

    full, tenth = change(1.0), change(1e-2)
    assert full > 1e-11
    assert tenth < 0.2 * full


def test_friction_and_drag_slow_the_block_both_ways(base):
    for text in (
        "coulomb_friction:force_n=1e-4",
        "viscous_drag:coefficient_n_s_per_m=5e-4",
        "quadratic_drag:coefficient_n_s2_per_m2=2e-3",
        "bristle_friction:force_n=1e-4",
    ):
        run, _ = _run(text)
        assert abs(run.velocity_in_m_per_s) < SPEED
        assert run.velocity_out_m_per_s < base.velocity_out_m_per_s
        last = run.block_velocity_m_per_s(np.array([0.0599]))[0]
        assert last < run.velocity_out_m_per_s


def test_coulomb_friction_takes_force_times_way():
    run, _ = _run("coulomb_friction:force_n=1e-4")
    lost = 0.5 * Bodies().block_mass_kg * (SPEED**2 - run.velocity_in_m_per_s**2)
    assert lost == pytest.approx(1e-4 * 3e-3, rel=1e-6)


def test_a_gradient_of_the_bearing_is_a_weak_spring_on_the_block():
    """From 3 mm off the middle to the middle, where it touches the plate, the block gains the energy of the spring."""
    run, _ = _run("bearing_gradient:stiffness_n_per_m=0.1")
    gained = 0.5 * Bodies().block_mass_kg * (run.velocity_in_m_per_s**2 - SPEED**2)
    assert gained == pytest.approx(0.5 * 0.1 * 3e-3**2, rel=1e-6)


def test_tilt_pulls_to_one_side(base):
    run, _ = _run("tilt:angle_rad=1e-3")
    assert run.velocity_in_m_per_s > -SPEED and run.block_m(np.array([0.06]))[0] > base.block_m(np.array([0.06]))[0]
    slope = np.polyfit(TIME[:900], run.block_velocity_m_per_s(TIME[:900]), 1)[0]
    assert slope == pytest.approx(9.80665e-3, rel=1e-4)


def test_a_harder_or_lossier_plate_acts_in_contact_alone(base):
    soft = _run("support_compliance:compliance_m_per_n=1e-4,frequency_hz=1000")[0]
    hard = _run("cubic_stiffness:coefficient_n_per_m3=1e6")[0]
    lossy = _run("plate_damping:coefficient_n_s_per_m=2e-3")[0]
    before = base.touch_time_s > TIME
    for run in (soft, hard, lossy):
        assert np.abs(run.block_m(TIME[before]) - base.block_m(TIME[before])).max() < 1e-15
    assert soft.block_m(TIME).min() < base.block_m(TIME).min() < hard.block_m(TIME).min()
    assert lossy.velocity_out_m_per_s < base.velocity_out_m_per_s


def test_hidden_mass_rings_after_the_first_touch_at_its_own_frequency():
    run, _ = _run("block_mode:mass_kg=5e-4,frequency_hz=1000,damping_ratio=0.002")
    after = TIME[run.release_time_s + 1e-3 < TIME]
    v = run.block_velocity_m_per_s(after)
    v = v - np.polyval(np.polyfit(after, v, 1), after)
    frequency = np.fft.rfftfreq(1 << 16, 1e-5)
    line = frequency[np.argmax(np.abs(np.fft.rfft(v * np.hanning(v.size), 1 << 16)))]
    free = 1000 * np.sqrt(17.85e-3 / (17.85e-3 - 5e-4))  # both masses move
    assert line == pytest.approx(free, rel=5e-3)


def test_adhesion_holds_the_block_back_and_is_paid_back_on_the_way_in():
    run, _ = _run("adhesion:force_n=5e-3,range_m=1e-4")
    late = run.block_velocity_m_per_s(np.array([run.release_time_s + 5e-3]))[0]
    assert late < run.velocity_out_m_per_s
    assert abs(run.velocity_in_m_per_s) > SPEED


def test_what_only_the_optics_see_leaves_the_block_alone(base):
    drift = parse("sensor_drift:ramp_m_per_s2=1e-3")
    x, v = measured_path(base, drift, TIME)
    assert v - base.block_velocity_m_per_s(TIME) == pytest.approx(1e-3 * TIME, abs=1e-12)
    lag = parse("demodulation_lag:time_s=1e-5")
    x, _ = measured_path(base, lag, TIME)
    flight = (TIME > 1e-3) & (base.touch_time_s > TIME)
    assert x[flight] - base.block_m(TIME[flight]) == pytest.approx(SPEED * 1e-5, rel=1e-6)  # it lags behind
    for begin in (np.zeros(1), np.array([0.0, 1e-6])):  # from the first moment on
        x, v = measured_path(base, lag, begin)
        assert x - base.block_m(begin) == pytest.approx(SPEED * 1e-5, rel=1e-6) and v == pytest.approx(-SPEED, rel=1e-6)
    shake = parse("frame_vibration:amplitude_m_per_s=1e-4,frequency_hz=100,phase_rad=1.0")
    x, v = measured_path(base, shake, TIME)
    extra = v - base.block_velocity_m_per_s(TIME)
    assert extra == pytest.approx(1e-4 * np.sin(2 * np.pi * 100 * TIME + 1.0), abs=1e-12)
    assert np.gradient(x - base.block_m(TIME), 1e-5)[1:-1] == pytest.approx(extra[1:-1], abs=1e-8)


@pytest.mark.parametrize("order", [1, 2])
def test_cyclic_error_repeats_with_the_way(order):
    optics = with_cyclic_error(Optics(), parse(f"cyclic_error:amplitude_m=2e-9,order={order}"))
    x = np.linspace(0.0, 2 * optics.wavelength_m, 4001)
    error = cyclic_m(optics, x)
    assert np.abs(error).max() == pytest.approx(2e-9, rel=1e-2)
    period = 1000 // order  # half a wavelength over the order
    assert error[period:] == pytest.approx(error[:-period], abs=1e-13)


def test_what_differs_from_shot_to_shot_does():
    effects = parse("plate_motion:velocity_m_per_s=1e-3,displacement_m=1e-6;tilt:angle_rad=1e-4")
    first, second, again = (effects_of_shot(effects, shot, 5) for shot in (0, 1, 1))
    assert first == effects and second == again
    assert second["plate_motion"] != first["plate_motion"] and second["tilt"] == first["tilt"]


def test_what_differs_from_shot_to_shot_is_never_larger_than_in_the_first_and_of_either_sign():
    effects = parse("plate_motion:velocity_m_per_s=1e-3,displacement_m=1e-6")
    drawn = [effects_of_shot(effects, shot, 5)["plate_motion"] for shot in range(1, 200)]
    for key, first in effects["plate_motion"].items():
        shares = np.array([values[key] / first for values in drawn])
        assert 0.3 <= np.abs(shares).min() < 0.35 and 0.95 < np.abs(shares).max() <= 1.0
        assert 60 < np.count_nonzero(shares < 0.0) < 140


def test_a_recording_says_where_the_bench_stood(tmp_path):
    shaken, quiet = (simulate(tmp_path / name, 1, 3, site=site_named(name)) for name in ("VC-B", "quiet"))
    one, other = (read_recording(paths[0]) for paths in (shaken, quiet))
    assert "at VC-B" in one.note and " at " not in other.note
    assert not np.array_equal(one.counts, other.counts)
