"""What a laboratory does to a shot, for tests: a path that moves, knocks, samples that are lost.

Made here and sharing nothing with the analysis: lines of machines, the hum of a floor between 1 and 200 Hz in the shape
of the vibration criteria (the same velocity in every third of an octave from 8 to 80 Hz), and knocks that ring out.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot.motion import Motion
from analysis.shot.recording import Recording
from tests.analysis.synthetic_collision import Synthetic, motion_from, position_m

Floats = NDArray[np.float64]
CRITERIA_M_PER_S = {"VC-A": 50e-6, "VC-C": 12.5e-6, "VC-D": 6.25e-6, "VC-E": 3.12e-6, "VC-G": 0.78e-6}
_WAVES_A_THIRD = 6


@dataclass(frozen=True)
class Line:
    """A machine that runs: x = amplitude sin(2 pi f t + phase)."""

    frequency_hz: float
    amplitude_m: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Knock:
    """A blow on the table at a time, that rings out."""

    time_s: float
    amplitude_m: float
    frequency_hz: float = 180.0
    decay_s: float = 2e-3


@dataclass(frozen=True)
class Disturbance:
    """Everything that moves the measured path beside the block."""

    lines: tuple[Line, ...] = ()
    knocks: tuple[Knock, ...] = ()
    criterion: str | None = None  # "VC-A" ... "VC-G"
    seed: int = 1

    def displacement_m(self, time_s: Floats) -> Floats:
        """Return what is added to the path at any times."""
        x = np.zeros_like(time_s)
        for line in (*self.lines, *self._floor()):
            x += line.amplitude_m * np.sin(2 * np.pi * line.frequency_hz * time_s + line.phase_rad)
        for knock in self.knocks:
            u = np.maximum(time_s - knock.time_s, 0.0)
            x += knock.amplitude_m * np.exp(-u / knock.decay_s) * np.sin(2 * np.pi * knock.frequency_hz * u)
        return x

    def _floor(self) -> list[Line]:
        if self.criterion is None:
            return []
        random = np.random.default_rng((self.seed, 0xF100))
        rms_m_per_s = CRITERIA_M_PER_S[self.criterion]
        waves = []
        for third in np.arange(0, 24):  # 1 to 200 Hz; below 8 Hz the displacement stays, above 80 Hz the velocity falls
            low = 10 ** (third / 10)
            each = rms_m_per_s * min(1.0, low / 8.0) * min(1.0, (80.0 / low) ** 2)
            for _ in range(_WAVES_A_THIRD):
                frequency = float(low * 10 ** (random.uniform(0, 1) / 10))
                speed = each * np.sqrt(2.0 / _WAVES_A_THIRD) * random.rayleigh(np.sqrt(0.5))
                waves.append(Line(frequency, speed / (2 * np.pi * frequency), random.uniform(0, 2 * np.pi)))
        return waves


def disturbed_motion(rig: Synthetic, disturbance: Disturbance, seed: int = 1) -> Motion:
    """Return the motion of a rig whose path moves, with white noise."""
    time = np.arange(0.0, rig.duration_s, 1.0 / rig.rate_hz)
    x = position_m(rig, time) + disturbance.displacement_m(time)
    return motion_from(time, x + np.random.default_rng(seed).normal(0.0, rig.noise_m, time.size), rig)


def without_samples(recording: Recording, losses: dict[int, int]) -> Recording:
    """Return the recording as a digitizer leaves it that drops ``losses[start]`` samples from ``start`` on, unsaid."""
    keep = np.ones(recording.samples, dtype=np.bool_)
    for start, lost in losses.items():
        keep[start : start + lost] = False
    counts = np.ascontiguousarray(recording.counts[keep])
    counts.flags.writeable = False
    trigger = recording.trigger_sample
    if trigger is not None:
        trigger = int(np.count_nonzero(keep[:trigger]))
    return replace(recording, counts=counts, trigger_sample=trigger)
