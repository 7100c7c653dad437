"""What the simulated rig makes of a seed, as numbers against those written down (``written/seed.txt``).

A seed names the same shots in every version: what was measured on one stays true of it (docs/closed-loop-benchmark.md).
After an intended change ``make screen`` writes the file anew.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from instrument.bench.digitizer import BenchDigitizer
from instrument.bench.effects import ALL, PER_SHOT, complete, draw, effects_of_shot, force_slots
from instrument.bench.frame import frame_of
from instrument.bench.measured_path import measured_path, simulate_collision, with_cyclic_error
from instrument.bench.mechanics import Bodies
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench, SimulatedStream
from instrument.bench.simulated_shots import draw_undeclared, record_shot, simulate_shot, speeds_of_set
from instrument.bench.sines import path_vibration
from instrument.bench.site import Knock, Line, Site, site_named
from instrument.devices.digitizer import CaptureSettings
from tests.bench.plate import plate_m
from tests.bench.scaled import scaled

KEPT = Path(__file__).parent / "written" / "seed.txt"
SHAKEN = Site(
    third_octave_m_per_s=5e-6,
    lines=(Line(33.0, 2e-7), Line(410.0, 1e-9)),
    knocks=(Knock(4e-7, at_s=0.004), Knock(2e-7, frequency_hz=140.0, decay_s=0.004, share=0.5)),
    spectrum=((0.7, 1e-5), (20.0, 4e-5), (300.0, 1e-5)),
)
TIME = np.array([0.0, 0.007, 0.0081, 0.0093, 0.012, 0.0223, 0.0412])

Numbers = tuple[str, list[float], float]  # a name, numbers, and by how much one may be off beside a millionth of itself


def _flat(values: Mapping[str, object]) -> list[float]:
    return [float(v) for v in values.values() if isinstance(v, int | float)]


def _of_effects() -> Iterator[Numbers]:
    yield "bodies", _flat(asdict(Bodies())), 0.0
    yield "optics", _flat(asdict(Optics())), 0.0
    yield "rig", _flat(asdict(Bench())), 0.0
    for name in ALL:
        yield f"{name}, usual", list(complete({name: {}})[name].values()), 0.0
        drawn = {name: draw(name, np.random.default_rng(5))}
        yield f"{name}, drawn", list(drawn[name].values()), 0.0
        yield f"{name}, three times as strong", list(scaled(drawn, 3.0)[name].values()), 0.0
        yield f"{name}, forces", [part for pair in sorted(force_slots(drawn).items()) for part in pair], 0.0
        run = simulate_collision(-0.31, drawn, Bodies(), 2.4e-3, 0.042)
        x, v = measured_path(run, drawn, TIME)
        optics = with_cyclic_error(Optics(), drawn)
        yield f"{name}, path in um", [*(x * 1e6), optics.leak_m * 1e9, optics.leak_order, optics.leak_turns], 1e-6
        yield f"{name}, its velocity in mm/s", list(v * 1e3), 1e-4
        yield f"{name}, plate in um", list(plate_m(run, TIME) * 1e6), 1e-4
        yield f"{name}, events in ms", [time * 1e3 for _, time in run.events], 1e-6


def _of_seeds() -> Iterator[Numbers]:
    for seed in range(1, 13):
        drawn = draw_undeclared(seed)
        yield f"undeclared {seed}: {', '.join(drawn)}", [v for values in drawn.values() for v in values.values()], 0.0
    for shots in (1, 4):
        yield f"speeds of {shots}", list(speeds_of_set(shots, 7)), 0.0
    for shot in range(3):
        drawn = effects_of_shot(complete({name: {} for name in PER_SHOT}), shot, 6)
        yield f"effects of shot {shot}", [v for values in drawn.values() for v in values.values()], 0.0
    for seed in (1, 4):
        x, v = path_vibration(3e-10, seed).motion(TIME)
        yield f"path of {seed} in pm and nm/s", [*(x * 1e12), *(v * 1e9)], 1e-4
    for name, site in (("VC-C", site_named("VC-C")), ("ISO-office", site_named("ISO-office")), ("shaken", SHAKEN)):
        frame = frame_of(site, 3).with_knocks(0.002, 2)
        sines = frame.sines
        sums = [sines.omega.size, *(float(part.sum()) for part in (sines.omega, sines.amplitude_m * 1e6, sines.phase))]
        yield f"{name}, sines", sums, 0.0
        x, v = frame.motion(TIME)
        yield f"{name}, frame in um and um/s", [*(x * 1e6), *(v * 1e6)], 1e-4
        spacing_s, a, jerk = frame.acceleration(0.02)
        yield f"{name}, acceleration", [spacing_s * 1e6, a.size, *(a[::50] * 1e3), *jerk[::50]], 1e-4
        yield f"{name}, plate before", [1e6 * part for part in frame.plate_response(1056.0)], 1e-4


def _of_shots() -> Iterator[Numbers]:
    rig = Bench(effects=complete({"cyclic_error": {}, "plate_motion": {}}), site=SHAKEN, seed=4, added_kg=2e-3)
    for index in (0, 1):
        played = simulate_shot(rig, index, 0.3, 0.04)
        yield f"shot {index}, seed", [played.seed % 10**9], 0.0
        yield f"shot {index}, block in um", list(played.trajectory.block_m(TIME[:-1]) * 1e6), 1e-4
    recording, _ = record_shot(rig, 1, 0.3, 10e6, 0.03)
    ends = [float(recording.trigger_sample or -1), float(recording.samples)]
    yield f"recording {recording.name} of {recording.started_at}", ends, 0.0
    yield "its counts", [float(v) for v in recording.counts[::17_771].ravel()], 1.0
    yield "their sizes", [*recording.counts.std(axis=0), *recording.counts.mean(axis=0)], 2e-3
    stream = SimulatedStream(Bench(site=SHAKEN, seed=9), 10e6)
    for _ in range(2):
        pushed = stream.push(0.1)
        times = [pushed.start_s, pushed.release_s, pushed.caught_s, pushed.end_s]
        yield f"push {stream.shots}", [*times, pushed.trajectory.velocity_out_m_per_s], 1e-7
        at = np.linspace(pushed.start_s - 0.01, pushed.end_s + 0.01, 12)
        path = stream.path(at)
        yield f"its path {stream.shots} in um", list(path.optical_m * 1e6), 1e-4
        yield f"its velocity {stream.shots} in um/s", list(path.optical_m_per_s * 1e6), 1e-2
        yield f"its block {stream.shots} in um", list(path.block_m * 1e6), 1e-4
    bench = BenchDigitizer(Bench(seed=5), real_time=False)
    bench.arm(CaptureSettings(10e6, 1, 0))
    counts, crossed = np.empty((200_000, 3), np.int16), []
    for block in range(100):
        bench.read_into(counts, 0.0)
        steps = np.flatnonzero(np.diff((counts[:, 2] > 1000).astype(int)))
        crossed += [float(block * 200_000 + at) for at in steps[:1]]
    yield "the switch of the bench fires at", crossed[:2], 5.0


def test_a_seed_is_the_same_rig_and_the_same_shots_in_every_version() -> None:
    made = [*_of_effects(), *_of_seeds(), *_of_shots()]
    if os.environ.get("LEVIMASS_WRITE_SCREEN"):
        text = [f"{name}: {' '.join(f'{v:.9g}' for v in values)}" for name, values, _ in made]
        KEPT.write_text("\n".join(text) + "\n", encoding="utf-8")
        return
    kept = [line.rpartition(":") for line in KEPT.read_text(encoding="utf-8").splitlines()]
    assert [name for name, _, _ in made] == [name for name, _, _ in kept]
    for (name, values, off), (_, _, text) in zip(made, kept, strict=True):
        assert values == pytest.approx([float(part) for part in text.split()], rel=1e-6, abs=off), name
