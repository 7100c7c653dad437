"""Write recordings of the simulated rig, with given effects or with an undeclared effect drawn at random."""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Recording
from instrument.bench.effects import CATALOGUE, OFF_CATALOGUE, Effects, complete, draw, effects_of_shot
from instrument.bench.frame import Frame, frame_of
from instrument.bench.measured_path import measured_path, simulate_collision, with_cyclic_error
from instrument.bench.mechanics import Trajectory
from instrument.bench.optics import Path as LightPath
from instrument.bench.optics import fill, node_times_s
from instrument.bench.rig import Bench
from instrument.bench.sines import path_vibration
from instrument.bench.site import QUIET, Site
from instrument.files import write_recording

SAMPLE_RATE_HZ = 10e6
DURATION_S = 0.06
BEFORE_TOUCH_S = 0.012
SLOWEST_M_PER_S, FASTEST_M_PER_S = 0.16, 0.40
_EPOCH = datetime.fromisoformat("2026-01-01T09:00:00")  # UTC; fixed, so that a seed gives the same files on any day


def simulate(
    folder: Path | str,
    shots: int | Sequence[float] = 3,
    seed: int = 1,
    effects: Effects | None = None,
    undeclared: bool = False,
    *,
    sample_rate_hz: float = SAMPLE_RATE_HZ,
    duration_s: float = DURATION_S,
    site: Site = QUIET,
) -> list[Path]:
    """Write recordings of one simulated rig into ``folder``; return the paths of their metadata files.

    ``shots`` is their number, or the speed of each in m/s.  The same seed gives the same counts.  ``undeclared`` draws
    the effects (or none) from the seed and writes them, as base64 of JSON, to ``.truth-SEED`` in the folder, which a
    search for recordings ignores.  Raises ValueError for an unknown effect, RecordingError if a write fails.
    """
    if undeclared and effects:
        raise ValueError("an undeclared effect is drawn from the seed; no other effect can be given")
    wanted = draw_undeclared(seed) if undeclared else complete(effects or {})
    rig = Bench(effects=wanted, site=site, seed=seed)
    speeds = speeds_of_set(shots, seed) if isinstance(shots, int) else tuple(shots)
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    truths: list[Effects] = []
    for index, speed in enumerate(speeds):
        recording, truth = record_shot(rig, index, speed, sample_rate_hz, duration_s)
        if not undeclared:
            recording = replace(recording, note=_note(truth, site))
        paths.append(Path(write_recording(recording, place / recording.name)))
        truths.append(truth)
    if undeclared:
        text = json.dumps({"seed": seed, "shots": truths})
        (place / f".truth-{seed}").write_bytes(base64.b64encode(text.encode()) + b"\n")
    return paths


def speeds_of_set(shots: int, seed: int) -> tuple[float, ...]:
    """Return different speeds (m/s) for a set of shots, spread over the range of a push by hand."""
    random = np.random.default_rng((seed, 0xA))
    if shots == 1:
        return (float(random.uniform(0.22, 0.32)),)
    edges = np.linspace(SLOWEST_M_PER_S, FASTEST_M_PER_S, shots)
    width = (FASTEST_M_PER_S - SLOWEST_M_PER_S) / (shots - 1)
    return tuple(float(s) for s in edges + random.uniform(-0.15, 0.15, shots) * width)


def draw_undeclared(seed: int) -> dict[str, dict[str, float]]:
    """Draw effects from the seed: one of the catalogue (60 %), two (10 %), one outside it (15 %), or none (15 %)."""
    random = np.random.default_rng((seed, 0xD))
    share = random.random()
    names = list(CATALOGUE)
    if share < 0.6:
        chosen = [str(random.choice(names))]
    elif share < 0.7:
        chosen = [str(name) for name in random.choice(names, 2, replace=False)]
    elif share < 0.85:
        chosen = [str(random.choice(list(OFF_CATALOGUE)))]
    else:
        chosen = []
    return {name: draw(name, random) for name in chosen}


@dataclass(frozen=True, slots=True)
class SimulatedShot:
    """The true motion of one shot and its effects; time zero is the first sample."""

    trajectory: Trajectory
    frame: Frame
    effects: dict[str, dict[str, float]]
    seed: int


def simulate_shot(rig: Bench, index: int, speed_m_per_s: float, duration_s: float) -> SimulatedShot:
    effects = effects_of_shot(complete(rig.effects), index, rig.seed)
    distance = max(speed_m_per_s * BEFORE_TOUCH_S, rig.optics.switch_m + 1e-3)
    seed = int(np.random.default_rng((rig.seed, index, 0xC)).integers(2**62))
    frame = frame_of(rig.site, seed).with_knocks(0.0, index)
    trajectory = simulate_collision(
        -speed_m_per_s, effects, rig.bodies_with_weights, distance, duration_s + 1e-4, frame
    )
    return SimulatedShot(trajectory, frame, effects, seed)


def record_shot(
    rig: Bench, index: int, speed_m_per_s: float, sample_rate_hz: float, duration_s: float
) -> tuple[Recording, dict[str, dict[str, float]]]:
    """Simulate one shot of the rig; return its recording and its effects."""
    played = simulate_shot(rig, index, speed_m_per_s, duration_s)
    return recording_of(rig, index, played, sample_rate_hz, duration_s), played.effects


def recording_of(rig: Bench, index: int, played: SimulatedShot, sample_rate_hz: float, duration_s: float) -> Recording:
    optics = with_cyclic_error(rig.optics, played.effects)
    samples = round(duration_s * sample_rate_hz)
    time_s = node_times_s(0, samples, sample_rate_hz)
    x, v = measured_path(played.trajectory, played.effects, time_s)
    shake_x, shake_v = path_vibration(rig.floor_m, played.seed).motion(time_s)
    block = played.trajectory.block_m(time_s)
    counts: NDArray[np.int16] = np.empty((samples, len(optics.channels)), np.int16)
    clipped = fill(optics, LightPath(time_s, x + shake_x, v + shake_v, block), 0, sample_rate_hz, played.seed, counts)
    crossed = np.flatnonzero(block < optics.switch_m)
    return Recording(
        name=f"shot-{index + 1}",
        counts=counts,
        sample_rate_hz=sample_rate_hz,
        channels=optics.channels,
        setup=rig.setup,
        trigger_sample=round(time_s[crossed[0]] * sample_rate_hz) if crossed.size else None,
        started_at=(_EPOCH + timedelta(seconds=60 * rig.seed % 10**7 + index)).strftime("%Y-%m-%dT%H:%M:%SZ"),
        flags=("clipped",) if any(clipped) else (),
    )


def _note(effects: Effects, site: Site) -> str:
    at = f" at {site.name}" if site.moves else ""
    if not effects:
        return f"simulated{at}; the paper's plate and contact, nothing else"
    parts = (f"{name} " + ", ".join(f"{k} = {v:.6g}" for k, v in values.items()) for name, values in effects.items())
    return f"simulated{at} with " + "; ".join(parts)
