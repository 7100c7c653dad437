"""Shots of a bench in a building, with what was true of each and how well the best estimator could have read it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from analysis.shot.recording import Recording
from instrument.bench import forces as slot
from instrument.bench.frame import density_m2_per_hz
from instrument.bench.mechanics import Bodies, Trajectory, collide
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import SimulatedShot, recording_of, simulate_shot
from instrument.bench.sines import PATH_HIGHEST_HZ as HIGHEST_HZ
from instrument.bench.sines import PATH_LOWEST_HZ as LOWEST_HZ
from instrument.bench.site import LEVELS_M_PER_S, Knock, Line, Site, site_named
from tests.bench.displacement_noise import displacement_noise_m
from tests.bench.plate import plate_m

Floats = NDArray[np.float64]
SITES = tuple(name for name in LEVELS_M_PER_S if name.startswith("VC"))
CONDITIONS = ("plain", "line", "knock", "losses", "low light", "8 bits")
RATE_HZ, DURATION_S = 10e6, 0.06
_GRID_HZ = 100e3
TILTED_M_PER_S2 = 1e-3  # of a flight, by a tilt of 0.1 mrad or a good bearing's friction
_BOUND_HZ = 5e3  # of the samples that the bound is computed on: above all that shakes


@dataclass(frozen=True, slots=True)
class Case:
    """One shot of the benchmark; everything follows from ``seed`` and ``index``."""

    seed: int
    index: int

    @property
    def site(self) -> str:
        """Get where the bench stands."""
        return SITES[self.index % len(SITES)]

    @property
    def condition(self) -> str:
        """Get what is wrong beside the site."""
        return CONDITIONS[self.index // len(SITES) % len(CONDITIONS)]


@dataclass(frozen=True, slots=True)
class Drawn:
    """A case as it happened: the recording, the truth by the result's names, the least standard deviations."""

    recording: Recording
    truth: dict[str, float]
    bound: dict[str, float]
    bent: dict[str, float]  # the same where nobody knows how level the bearing is


def draw(case: Case) -> Drawn:
    """Let a case happen."""
    random = np.random.default_rng((case.seed, case.index, 0xC0))
    rig = Bench(_bodies(random), _optics(case.condition), {}, _site(case, random), seed=case.seed)
    speed = float(random.uniform(0.16, 0.40))
    played = simulate_shot(rig, case.index, speed, DURATION_S)
    recording = recording_of(rig, case.index, played, RATE_HZ, DURATION_S)
    if case.condition == "losses":
        recording = _lossy(recording, played, random)
    return Drawn(recording, truth(played, rig.bodies, speed), bound(rig, played), bound(rig, played, TILTED_M_PER_S2))


def _bodies(random: np.random.Generator) -> Bodies:
    """Return bodies near the paper's, no two alike."""
    usual = Bodies()
    scales = random.uniform((0.85, 0.9, 0.7, 0.7), (1.15, 1.1, 1.4, 1.4))
    return replace(
        usual,
        plate_mass_kg=usual.plate_mass_kg * scales[0],
        plate_stiffness_n_per_m=usual.plate_stiffness_n_per_m * scales[1],
        contact_stiffness_n_per_m=usual.contact_stiffness_n_per_m * scales[2],
        contact_damping_n_s_per_m=usual.contact_damping_n_s_per_m * scales[3],
    )


def _optics(condition: str) -> Optics:
    usual = Optics()
    if condition == "low light":  # an eighth of the light, the same electronics
        return replace(usual, measurement_v=usual.measurement_v / 8, measurement_snr_db=usual.measurement_snr_db - 18)
    return replace(usual, bits=8) if condition == "8 bits" else usual


def _site(case: Case, random: np.random.Generator) -> Site:
    site = site_named(case.site)
    size = float(np.exp(random.uniform(np.log(10e-9), np.log(100e-9))))
    if case.condition == "line":
        return replace(site, lines=(*site.lines, Line(float(random.uniform(25.0, 600.0)), size)))
    if case.condition == "knock":
        return replace(site, knocks=(Knock(size, float(random.uniform(30.0, 200.0))),))
    return site


def _lossy(recording: Recording, played: SimulatedShot, random: np.random.Generator) -> Recording:
    """Return the recording without 1 to 24 short runs of samples inside the contact, of which nobody knows."""
    events = [time for _, time in played.trajectory.events]
    first, last = (round(time * RATE_HZ) for time in (events[0], events[-1]))
    starts = random.integers(first, last, int(random.integers(1, 25)))
    lost = np.unique(np.concatenate([start + np.arange(int(random.integers(1, 5))) for start in starts]))
    trigger = recording.trigger_sample
    if trigger is not None:
        trigger -= int(np.sum(lost < trigger))
    return replace(recording, counts=np.delete(recording.counts, lost, axis=0), trigger_sample=trigger)


def truth(played: SimulatedShot, bodies: Bodies, speed_m_per_s: float) -> dict[str, float]:
    """Return what a shot's numbers were, by the names of the result.

    Velocities are the block's in space, where its flight is straight; the force is the one on the block; deflection
    and instants are against the frame that carries the plate.
    """
    run = played.trajectory
    touches = [time for what, time in run.events if what == "touch"]
    releases = [time for what, time in run.events if what == "release"]
    first, last = touches[0], releases[-1]
    moved = played.frame.motion(np.array([first, last]))[1]
    v_in, v_out = run.velocity_in_m_per_s + float(moved[0]), run.velocity_out_m_per_s + float(moved[1])
    time_s = np.arange(round(DURATION_S * _GRID_HZ)) / _GRID_HZ
    force = force_n(run, bodies, time_s)
    deflection = float(run.block_m(np.array([first]))[0]) - run.block_m(time_s)
    span = last - first
    body = (time_s > first + 0.209 * span) & (time_s < first + 0.975 * span)
    result = {
        "velocity_in_m_per_s": v_in,
        "velocity_out_m_per_s": v_out,
        "cor_quasi_static": v_out / abs(v_in),
        "cor_impulse": v_out / abs(v_in),
        "cor_kinetic.contact": _restitution_of_contact(bodies, speed_m_per_s),
        "force_peak_n": float(force[body].max()),
        "force_fwhm_s": _fwhm_s(time_s, force),
        "contact_time_s": span,
        "deflection_max_m": float(deflection.max()),
        "stiffness_slope_n_per_m": float(np.polyfit(deflection[body], force[body], 1)[0]),
        "fit.plate_stiffness_n_per_m": bodies.plate_stiffness_n_per_m,
        "fit.plate_mass_kg": bodies.plate_mass_kg,
        "fit.contact_stiffness_n_per_m": bodies.contact_stiffness_n_per_m,
        "fit.contact_damping_n_s_per_m": bodies.contact_damping_n_s_per_m,
    }
    if len(touches) >= 3:
        result["cor_kinetic.onsets"] = (touches[2] - touches[1]) / (touches[1] - touches[0])
        result["cor_kinetic.flights"] = (touches[2] - releases[1]) / (touches[1] - releases[0])
        peaks = [_first_top_s(run, bodies, touch) for touch in touches[:3]]
        result["cor_kinetic.force_peaks"] = (peaks[2] - peaks[1]) / (peaks[1] - peaks[0])
    return result


def force_n(run: Trajectory, bodies: Bodies, time_s: Floats) -> Floats:
    """Return the force of the plate on the block at ascending times."""
    overlap = plate_m(run, time_s) - run.block_m(time_s)
    rate = np.interp(time_s, run.time_s, run.states[:, slot.PLATE_V]) - run.block_velocity_m_per_s(time_s)
    pushed = bodies.contact_stiffness_n_per_m * overlap + bodies.contact_damping_n_s_per_m * rate
    return np.where(overlap > 0, pushed, 0.0)


def _first_top_s(run: Trajectory, bodies: Bodies, touch_s: float) -> float:
    """Return when the force has its first maximum after a touch."""
    time_s = touch_s + np.arange(1, 2000) * 5e-7
    force = force_n(run, bodies, time_s)
    rising = np.diff(force) > 0
    start = int(np.argmax(rising))  # the dashpot's own step at touch may fall at first
    return float(time_s[start + int(np.argmin(rising[start:]))])


def _fwhm_s(time_s: Floats, force: Floats) -> float:
    """Return the width of the pulse that is low-passed at 250 Hz, without its bounces."""
    smooth = sosfiltfilt(butter(2, 250.0, fs=_GRID_HZ, output="sos"), force)
    top = int(smooth.argmax())
    half = smooth[top] / 2
    left, right = int(np.flatnonzero(smooth[:top] < half)[-1]), top + int(np.flatnonzero(smooth[top:] < half)[0])
    begin = np.interp(half, smooth[left : left + 2], time_s[left : left + 2])
    finish = np.interp(-half, -smooth[right - 1 : right + 1], time_s[right - 1 : right + 1])
    return float(finish - begin)


def _restitution_of_contact(bodies: Bodies, speed_m_per_s: float) -> float:
    """Return -(relative velocity out / in) of the first contact on a plate at rest."""
    run = collide(-speed_m_per_s, bodies=bodies, duration_s=2e-3 / speed_m_per_s + 2e-3)
    (_, begin), (_, end) = run.events[:2]
    at = [int(np.searchsorted(run.time_s, time)) for time in (begin, end)]
    before, after = (float(run.states[i, slot.BLOCK_V] - run.states[i, slot.PLATE_V]) for i in at)
    return -after / before


def bound(rig: Bench, played: SimulatedShot, bent_m_per_s2: float = 0.0) -> dict[str, float]:
    """Return the least standard deviations of what the flights tell, given the true spectrum of all that shakes.

    ``bent_m_per_s2`` is how large an acceleration of its own each flight may have.

    Generalised least squares of two straight flights with the covariance of frame, optics and floor; lines have
    known frequencies, unknown amplitudes and phases.  A knock is not in it: it is taken as known.
    """
    touch, release = played.trajectory.touch_time_s, played.trajectory.release_time_s
    time_s = np.arange(round(DURATION_S * _BOUND_HZ)) / _BOUND_HZ
    before, after = time_s < touch, time_s > release
    keep = before | after
    lag = np.arange(time_s.size) / _BOUND_HZ
    frequency_hz = np.geomspace(0.5, 1000.0, 3000)
    density = density_m2_per_hz(rig.site, frequency_hz) + _floor_density(rig.floor_m, frequency_hz)
    covariance = np.trapezoid(density * np.cos(2 * np.pi * np.outer(lag, frequency_hz)), frequency_hz, axis=1)
    covariance[0] += displacement_noise_m(rig.optics, RATE_HZ, _BOUND_HZ) ** 2
    index = np.flatnonzero(keep)
    matrix = covariance[np.abs(index[:, None] - index[None, :])]
    columns = [before, before * (time_s - touch), after, after * (time_s - release)]
    for line in rig.site.lines:
        angle = 2 * np.pi * line.frequency_hz * time_s
        # amplitudes are known to their order: a prior keeps slow lines from being confounded with a flight
        wave = np.stack((np.cos(angle), np.sin(angle)))[:, keep]
        matrix = matrix + line.amplitude_m**2 / 2 * (wave.T @ wave)
    columns += [before * (time_s - touch) ** 2 / 2, after * (time_s - release) ** 2 / 2] if bent_m_per_s2 else []
    design = np.stack(columns, axis=1)[keep].astype(np.float64)
    normal = design.T @ np.linalg.solve(matrix, design)
    normal[4:, 4:] += np.eye(len(columns) - 4) / (bent_m_per_s2 or 1.0) ** 2
    found = np.linalg.inv(normal)[:4, :4]
    v_in, v_out = abs(played.trajectory.velocity_in_m_per_s), played.trajectory.velocity_out_m_per_s
    ratio = np.array([0.0, v_out / v_in**2, 0.0, 1 / v_in])  # of |v_out / v_in|, v_in negative
    return {
        "velocity_in_m_per_s": float(np.sqrt(found[1, 1])),
        "velocity_out_m_per_s": float(np.sqrt(found[3, 3])),
        "cor_quasi_static": float(np.sqrt(ratio @ found @ ratio)),
    }


def _floor_density(rms_m: float, frequency_hz: Floats) -> Floats:
    """Return the optical floor's density: 64 lines closer together the lower they are, amplitudes falling as f^-1/2."""
    inside = (frequency_hz >= LOWEST_HZ) & (frequency_hz <= HIGHEST_HZ)
    shape = np.where(inside, frequency_hz**-2.0, 0.0)  # lines per Hz as 1/f, power of each as 1/f
    return rms_m**2 * shape / np.trapezoid(shape, frequency_hz)
