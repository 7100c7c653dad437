"""The site of the simulated rig: criterion curves, lines, knocks, a measured spectrum, their effects."""

import numpy as np
import pytest

from instrument.bench import forces as slot
from instrument.bench.frame import frame_of
from instrument.bench.mechanics import Bodies, collide
from instrument.bench.rig import Bench, SimulatedStream
from instrument.bench.site import LEVELS_M_PER_S, QUIET, Knock, Line, Site, site_named
from tests.bench.plate import plate_m

RATE = 2e3
BODIES = Bodies()


def _third_octaves(frame, seconds=2.0):
    """Return centre frequencies (Hz) and rms velocity (m/s) of third-octaves, by the periodogram."""
    time_s = np.arange(round(seconds * RATE)) / RATE
    v = frame.motion(time_s)[1]
    power = 2 * np.abs(np.fft.rfft(v * np.hanning(v.size))) ** 2 / np.sum(np.hanning(v.size) ** 2) / v.size
    frequency = np.fft.rfftfreq(v.size, 1 / RATE)
    centres = 10 ** (np.arange(3, 24) / 10)
    inside = [(frequency >= c * 10**-0.05) & (frequency < c * 10**0.05) for c in centres]
    return centres, np.sqrt([power[part].sum() for part in inside])


@pytest.mark.parametrize("name", ["VC-A", "ISO-office"])
def test_a_site_moves_as_its_curve_allows(name):
    level = site_named(name).third_octave_m_per_s
    curves = [_third_octaves(frame_of(Site(third_octave_m_per_s=level), seed)) for seed in range(5)]
    centres = curves[0][0]
    rms = np.sqrt(np.mean([r**2 for _, r in curves], axis=0))
    band = (centres >= 8) & (centres <= 80)
    assert rms[band] == pytest.approx(LEVELS_M_PER_S[name], rel=0.35)  # 5 seeds of 12 sines: 13 % each
    assert rms[centres < 5].max() < 0.8 * level and rms[centres > 120].max() < 0.6 * level


def test_lines_and_a_measured_spectrum_are_in_the_motion_as_stated():
    line = frame_of(Site(lines=(Line(24.9, 50e-9),)), 3).motion(np.arange(4000) / RATE)[0]
    assert line.std() == pytest.approx(50e-9 / np.sqrt(2), rel=0.01)
    flat = Site(spectrum=((5.0, 2e-4), (400.0, 2e-4)))  # m/s2/sqrt(Hz)
    time_s = np.arange(round(2 * RATE)) / RATE
    accelerations = [np.gradient(frame_of(flat, seed).motion(time_s)[1], 1 / RATE) for seed in range(4)]
    power = np.mean([np.abs(np.fft.rfft(a * np.hanning(a.size))) ** 2 for a in accelerations], axis=0)
    frequency = np.fft.rfftfreq(time_s.size, 1 / RATE)
    density = 2 * power / RATE / np.sum(np.hanning(time_s.size) ** 2)
    for low, high in ((8, 30), (30, 100), (100, 200)):
        part = (frequency >= low) & (frequency < high)
        assert np.sqrt(density[part].mean()) == pytest.approx(2e-4, rel=0.25)
    assert np.sqrt(density[(frequency > 500) & (frequency < 900)].mean()) < 1e-5


def test_the_block_in_flight_is_inertial_and_the_frame_stands_whole_in_what_is_measured():
    frame = frame_of(site_named("VC-A"), 5)
    run = collide(-0.265, frame=frame)
    time_s = np.linspace(0.0, 0.95 * run.touch_time_s, 200)
    moved = frame.motion(time_s)[0]
    assert np.ptp(moved) > 1e-7
    assert run.block_m(time_s) + moved == pytest.approx(2e-3 - 0.265 * time_s, abs=1e-13)


def test_a_bent_plate_follows_its_clamp():
    """Slow motion of the clamp carries block and plate along: against the frame they move as the spring tells."""
    frame = frame_of(Site(lines=(Line(20.0, 1e-6),)), 2)
    still, shaken = collide(-0.265), collide(-0.265, frame=frame)
    # the work that the clamp does on the bodies is what their energy in space gains
    y, t = shaken.states, shaken.time_s
    v = frame.motion(t)[1]
    force = BODIES.plate_stiffness_n_per_m * y[:, slot.PLATE_X]  # of the plate on its clamp, against it
    work = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] * v[1:] + force[:-1] * v[:-1]) * np.diff(t))))
    overlap = np.maximum(0.0, y[:, slot.PLATE_X] - y[:, slot.BLOCK_X])
    lost = BODIES.contact_damping_n_s_per_m * (y[:, slot.PLATE_V] - y[:, slot.BLOCK_V]) ** 2
    happened = np.searchsorted([time for _, time in shaken.events], 0.5 * (t[1:] + t[:-1]))
    touching = happened % 2 == 1  # the dashpot's power steps at touch and release
    lost = np.concatenate(([0.0], np.cumsum(np.where(touching, 0.5 * (lost[1:] + lost[:-1]) * np.diff(t), 0.0))))
    energy = (
        0.5 * BODIES.block_mass_kg * (y[:, slot.BLOCK_V] + v) ** 2
        + 0.5 * BODIES.plate_mass_kg * (y[:, slot.PLATE_V] + v) ** 2
        + 0.5 * BODIES.plate_stiffness_n_per_m * y[:, slot.PLATE_X] ** 2
        + 0.5 * BODIES.contact_stiffness_n_per_m * overlap**2
    )
    assert np.ptp(work) > 1e-8  # joules
    assert np.ptp(energy + lost + work) < 3e-3 * np.ptp(work)
    assert abs(shaken.velocity_out_m_per_s - still.velocity_out_m_per_s) > 1e-6


def test_the_plate_swings_before_it_is_touched():
    quiet, shaken = (collide(-0.265, frame=frame_of(site_named(name), 1)) for name in ("quiet", "VC-C"))
    assert np.all(plate_m(quiet, np.linspace(0, 7e-3, 50)) == 0.0)
    swing = plate_m(shaken, np.linspace(0, 7e-3, 50))
    assert 1e-9 < np.ptp(swing) < 1e-6


def test_a_quiet_frame_changes_nothing():
    free, quiet = collide(-0.3), collide(-0.3, frame=frame_of(QUIET, 1))
    assert np.array_equal(free.states, quiet.states)


def test_a_knock_begins_gently_rings_and_dies():
    site = Site(knocks=(Knock(50e-9, frequency_hz=80.0, decay_s=0.02, at_s=0.01),))
    frame = frame_of(site, 1).with_knocks(0.0, 0)
    x, v = frame.motion(np.arange(0, 0.3, 1e-5))
    assert not x[:1000].any() and np.abs(x).max() == pytest.approx(50e-9, rel=0.01)
    assert np.abs(x[15_000:]).max() < 1e-10
    assert np.gradient(x, 1e-5)[2:-2] == pytest.approx(v[2:-2], abs=1e-3 * np.abs(v).max())
    spacing, a, jerk = frame.acceleration(0.3)
    at_nodes = frame.motion(spacing * np.arange(a.size))[1]
    assert np.gradient(at_nodes, spacing)[2:900] == pytest.approx(a[2:900], abs=5e-3 * np.abs(a).max())
    begun = round(0.012 / spacing)  # a difference over the kink at the beginning is no slope
    assert np.gradient(a, spacing)[begun:900] == pytest.approx(jerk[begun:900], abs=1e-2 * np.abs(jerk).max())
    never = Site(knocks=(Knock(50e-9, share=0.0),))
    assert not frame_of(never, 1).with_knocks(0.0, 0).ringing


def test_the_stream_is_one_whatever_the_stretch_asked_for_and_runs_smoothly_through_the_hand():
    stage = SimulatedStream(Bench(site=site_named("VC-A"), floor_m=0.0), 10e6)
    scene = stage.push(0.1)
    around = scene.release_s + np.arange(-4000, 4000) * 5e-6
    path = stage.path(around)
    assert stage.path(around[3000:5000]).optical_m == pytest.approx(path.optical_m[3000:5000], abs=1e-13)
    assert np.diff(path.optical_m) / 5e-6 == pytest.approx(path.optical_m_per_s[:-1], abs=2e-4)
    assert np.abs(np.diff(path.optical_m, 2)).max() < 1e-9  # no step where the hand lets go


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ('criterion = "VC-Z"', "criterion: is one of"),
        ("third_octave_m_per_s = 1", "can be simulated"),
        ("[[line]]\nfrequency_hz = 50", "line[0].amplitude_m: missing"),
        ("[[line]]\nfrequency_hz = 1e9\namplitude_m = 1e-9", "Hz"),
        ('[[line]]\nfrequency_hz = "fast"\namplitude_m = 1e-9', "is not a number"),
        ("line = 3", "line: 3 is not a list"),
        ("[[knock]]\namplitude_m = nan", "knock[0].amplitude_m: nan is not"),
        ("[[knock]]\namplitude_m = 1e-9\nsize = 1", "knock[0].size: is none of"),
        ("[spectrum]\nfrequency_hz = [1, 2]", "a list of numbers is needed"),
        ("[spectrum]\nfrequency_hz = [2, 1]\nacceleration_m_per_s2_per_sqrt_hz = [1e-4, 1e-4]", "each above"),
        (
            "[spectrum]\nfrequency_hz = [1, 2]\nacceleration_m_per_s2_per_sqrt_hz = [1e-4, 1e-4]\nunit = 1",
            "spectrum.unit: is none of",
        ),
        (
            "[spectrum]\nfrequency_hz = [1, 2]\nacceleration_m_per_s2_per_sqrt_hz = [1e-4]",
            "spectrum.frequency_hz: 2 frequencies and 1 densities",
        ),
        ("[spectrum]\nfrequency_hz = []\nacceleration_m_per_s2_per_sqrt_hz = []", "0 frequencies and 0 densities"),
        (
            "[spectrum]\nfrequency_hz = [1, -2]\nacceleration_m_per_s2_per_sqrt_hz = [1, 1]",
            "of the spectrum is -2: 0.1 to 2000",
        ),
        ("[spectrum]\nfrequency_hz = [9]\nacceleration_m_per_s2_per_sqrt_hz = [1]", "at least two frequencies"),
        ('criterion = "VC-A"\nthird_octave_m_per_s = 1e-5', "criterion: is one of ISO-office, VC-A"),
        ("third_octave_m_per_s = 1.001", "third_octave_m_per_s is 1.001: 0 to 0.01 can be simulated"),
        ("[[line]]\nfrequency_hz = 50\namplitude_m = 2e-3", "amplitude_m of a line is 0.002: 0 to 0.001 can be"),
        ("colour = 1", "colour: is none of"),
        ("= 1", "not TOML"),
    ],
)
def test_a_file_that_is_no_site_is_refused_in_one_line(tmp_path, text, cause):
    path = tmp_path / "site.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"site\.toml") as refused:
        site_named(str(path))
    assert cause in str(refused.value) and "\n" not in str(refused.value)


def test_a_site_is_read_from_a_file(tmp_path):
    path = tmp_path / "cellar.toml"
    path.write_text(
        'criterion = "VC-D"\n[[line]]\nfrequency_hz = 24.9\namplitude_m = 3e-8\n'
        "[[knock]]\namplitude_m = 5e-8\nat_s = 0.004\nshare = 0.5\n"
        "[spectrum]\nfrequency_hz = [10, 20]\nacceleration_m_per_s2_per_sqrt_hz = [1e-4, 2e-4]\n"
    )
    site = site_named(str(path))
    assert site.name == "cellar" and site.third_octave_m_per_s == LEVELS_M_PER_S["VC-D"]
    assert site.lines == (Line(24.9, 3e-8),) and site.knocks == (Knock(5e-8, at_s=0.004, share=0.5),)
    assert site.spectrum == ((10.0, 1e-4), (20.0, 2e-4)) and site.moves and not QUIET.moves
    with pytest.raises(ValueError, match="no site is called 'VC-Z'"):
        site_named("VC-Z")
    with pytest.raises(ValueError, match="no such file"):
        site_named(str(tmp_path / "none.toml"))


def test_a_site_may_be_a_level_alone_under_a_name_of_its_own(tmp_path):
    path = tmp_path / "a.TOML"
    path.write_text('name = "annex"\nthird_octave_m_per_s = 2e-5\n')
    assert site_named(str(path)) == Site("annex", 2e-5)
    path.write_text("")
    assert site_named(str(path)) == Site("a") and not site_named(str(path)).moves
    for part in (Site(lines=(Line(1.0, 0.0),)), Site(knocks=(Knock(0.0),)), Site(spectrum=((1.0, 1.0), (2.0, 1.0)))):
        assert part.moves
