"""Which oscillator reads which part of a record: the beat is followed, so that a narrow band will do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signal.tuning import Tuning

BATCH = 64  # decimated samples read with one oscillator; their input stays in the first cache


@dataclass(frozen=True, slots=True, eq=False)
class Guide:
    """Which oscillator reads which batch: ``steps`` (g,) in PHASE_STEPS, ``batch`` (b,) an index into them."""

    steps: NDArray[np.int64]
    batch: NDArray[np.int32]

    @property
    def nominal(self) -> int:
        """Get the oscillator that phases are given relative to."""
        return int(self.steps[self.steps.size // 2])


def fixed_guide(tuning: Tuning, frequency_hz: float) -> Guide:
    """Return the guide of a beat that stays near one frequency."""
    return Guide(np.array([tuning.steps(frequency_hz)], np.int64), np.zeros(1, np.int32))


def following_guide(
    tuning: Tuning, sample: NDArray[np.int64], frequency_hz: NDArray[np.float64], samples: int, spacing_hz: float
) -> Guide:
    """Return the guide of a beat seen at ``frequency_hz`` (n,) at ``sample`` (n,): straight lines, rounded.

    ``samples`` is the recording's length, ``spacing_hz`` the distance between oscillators.
    """
    batches = samples // (BATCH * tuning.decimation) + 1
    centre = (np.arange(batches) + 0.5) * (BATCH * tuning.decimation)
    wanted = np.interp(centre, sample, frequency_hz)
    rounded = np.rint(wanted / spacing_hz).astype(np.int64)
    values, batch = np.unique(rounded, return_inverse=True)
    steps = np.array([tuning.steps(float(v) * spacing_hz) for v in values], np.int64)
    return Guide(steps, batch.reshape(-1).astype(np.int32))
