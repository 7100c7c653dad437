"""What a model leaves over, in displacement, velocity and force: the same samples and bandwidth before and after."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.floor import Floor
from analysis.diagnosis.result import Errors
from analysis.diagnosis.samples import Samples
from analysis.motion import Motion
from analysis.signal.filters import derivatives

Floats = NDArray[np.float64]


def errors(
    motions: Sequence[Motion],
    shots: Sequence[Samples],
    displacement_m: Sequence[Floats],
    floor: Floor,
    parameters: int,
) -> Errors:
    """Return the errors of modelled displacements (one a shot, on the motion's grid), pooled over the shots.

    Displacement at the motion's own rate; velocity and force through the motion's own filters, model and measurement
    alike.  ``reduced_chi2`` is whitened by ``floor`` (give the same one before and after), over samples less
    ``parameters``.
    """
    sums, counts = np.zeros(3), np.zeros(3)
    chi2, samples = 0.0, 0
    for motion, shot, model in zip(motions, shots, displacement_m, strict=True):
        velocity, acceleration = derivatives(model, motion.sample_rate_hz, motion.bandwidth_hz)
        left = (
            motion.displacement_m - model,
            motion.velocity_m_per_s - velocity,
            motion.moving_mass_kg * (motion.acceleration_m_per_s2 - acceleration),
        )
        for k, values in enumerate(left):
            good = values[shot.used & np.isfinite(values)]
            sums[k] += float(good @ good)
            counts[k] += good.size
        rest = (shot.displacement_m - shot.averaged(model))[:, None]
        white = floor.whiten(rest, shot.valid, shot.weight)
        chi2 += float(np.sum(white**2))
        samples += white.size
    rms = np.sqrt(sums / np.maximum(counts, 1))
    return Errors(float(rms[0]), float(rms[1]), float(rms[2]), chi2 / max(1, samples - parameters))
