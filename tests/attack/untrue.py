"""Recordings that are sound to look at and say what is not so: each is named, refused, or within its uncertainty.

So is one of a plate that still rings from the shot before: what is read of it is what happened.
"""

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert

from analysis.pipeline import analyse
from analysis.shot.consistency import flags_affecting
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings
from tests.analysis.synthetic_collision import Synthetic, true_of
from tests.attack.trial import SURVIVED, Attempt, refused_in_a_line
from tests.beats import REST_HZ, recording_of

Counts = NDArray[np.int16]
READ = AnalysisSettings(fit=False)
TOLD = ("velocity_in_m_per_s", "velocity_out_m_per_s", "deflection_max_m", "contact_time_s")
SIGMAS, SHARE = 6.0, 2e-5  # by which a number may lie off that nothing is said of


def untrue(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Wrong rates, cross-talk, swapped cables, time run backwards, pieces put together, buffers that come twice."""
    rig = Synthetic(speed_m_per_s=random_.uniform(0.1, 0.3))
    sound = recording_of(rig, seed=random_.randrange(1000))
    right = analyse(sound, READ).impact
    assert right is not None
    truth = {name: getattr(right, name).value for name in TOLD}

    def ringing() -> tuple[Recording, dict[str, float]]:
        rings = replace(rig, ring_m=10 ** random_.uniform(-9, -5), ring_rad=random_.uniform(0.0, 6.28))
        return recording_of(rings), true_of(rings)

    made: dict[str, Callable[[], tuple[Recording, dict[str, float]]]] = {
        "rate": lambda: (_rate(sound, random_.choice((-1, 1)) * 10 ** random_.uniform(-5, -1.3)), truth),
        "cross-talk": lambda: (_cross_talk(sound, random_), truth),
        "swapped": lambda: (_of(sound, sound.counts[:, [1, 0, 2]]), truth),
        "backwards": lambda: (_of(sound, sound.counts[::-1]), truth),
        "spliced": lambda: (_spliced(sound, random_), truth),
        "twice": lambda: (_twice(sound, random_), truth),
        "ringing": ringing,
    }
    names = list(made)
    while True:
        name = names.pop(0) if names else random_.choice(tuple(made))
        yield name, lambda name=name: _looked_at(*made[name](), refused=name in ("swapped", "backwards"))


def _looked_at(recording: Recording, truth: dict[str, float], *, refused: bool) -> str:
    shot = analyse(recording, READ)
    if shot.problem is not None:
        return refused_in_a_line(shot.problem)
    assert not refused, "taken for a sound shot"
    for name, true in truth.items():
        read = getattr(shot.impact, name)
        if not isinstance(read, Quantity) or flags_affecting(name, shot.flags):
            continue
        off = abs(read.value - true)
        assert off <= SIGMAS * read.std + SHARE * abs(true) or shot.flags, f"{name} is {read}, not {true:g}, unsaid"
        assert "rate_contradicted" not in shot.flags or off <= SIGMAS * read.std, f"{name} is {read}, not {true:g}"
    return SURVIVED


def _of(sound: Recording, counts: Counts) -> Recording:
    counts = np.ascontiguousarray(counts)
    counts.flags.writeable = False
    return replace(sound, counts=counts)


def _rate(sound: Recording, off: float) -> Recording:
    # below what a stated rest frequency is worth nothing can be said, and the timebase's own limit is in the budget
    stated = replace(sound.setup, rest_frequency_hz=REST_HZ, rest_frequency_u_hz=1e-7 * REST_HZ)
    return replace(sound, setup=stated, sample_rate_hz=(1.0 + off) * sound.sample_rate_hz)


def _cross_talk(sound: Recording, random_: random.Random) -> Recording:
    rest, beat, switch = sound.counts.T.astype(np.float64)
    share, angle = 10 ** random_.uniform(-3, -0.4), random_.uniform(-180.0, 180.0)
    turned = (hilbert(beat - beat.mean()) * np.exp(1j * np.deg2rad(angle))).real
    varies = random_.choice((0.0, 0.0, 0.0, 1.0)) * np.sin(np.linspace(0.0, random_.uniform(1.0, 60.0), rest.size))
    back = random_.choice((0.0, 0.0, 0.03))
    mixed = np.stack([rest + share * (1.0 + varies) * turned, beat + back * rest, switch], axis=1)
    return _of(sound, np.clip(np.rint(mixed), -2048, 2047).astype(np.int16))


def _spliced(sound: Recording, random_: random.Random) -> Recording:
    cuts = sorted(random_.sample(range(1000, sound.samples - 1000), random_.choice((1, 2, 5, 30, 200))))
    parts = [part[random_.randrange(1, 400) :] for part in np.split(sound.counts, cuts)]
    return _of(sound, np.concatenate(parts))


def _twice(sound: Recording, random_: random.Random) -> Recording:
    length = round(2 ** random_.uniform(6, 17))
    at = random_.randrange(length, sound.samples - length)
    again = sound.counts[at - length : at]
    if random_.random() < 0.5:
        return _of(sound, np.insert(sound.counts, at, again, axis=0))
    counts = sound.counts.copy()
    counts[at : at + length] = again
    return _of(sound, counts)
