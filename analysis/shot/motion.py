"""The measured motion of the block: displacement and its derivatives over time, each with its noise."""

from dataclasses import dataclass, field, fields
from typing import get_origin

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Floats as Floats
from analysis.shot.quantity import NotSeen, Reading
from analysis.shot.recording import Plate


@dataclass(frozen=True, slots=True)
class BeatQuality:
    """The quality of one beat, measured on the recording."""

    frequency_hz: float  # mean over the first quiet part
    amplitude_v: float
    snr_db: float  # A^2 / (2 sigma^2) over the whole digitizer band
    clipped_fraction: float


@dataclass(frozen=True, slots=True)
class Motion:
    """A shot's motion on a uniform time grid; right is positive, time zero is the recording's first sample.

    All arrays have shape (n,) and are read-only; ``*_std_*`` are the samples' standard deviations.
    Displacement is low-passed only by the decimation (flat to ``displacement_band_hz``), and its noise is white in that
    band.  Velocity, acceleration and force are low-passed at ``bandwidth_hz``, and their noise is not white.
    ``valid`` is False in gaps and drop-outs, where samples are NaN, never zero.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    force_n: Floats
    displacement_std_m: Floats
    velocity_std_m_per_s: Floats
    acceleration_std_m_per_s2: Floats
    force_std_n: Floats
    valid: NDArray[np.bool_]
    sample_rate_hz: float
    bandwidth_hz: float
    displacement_band_hz: float
    moving_mass_kg: float
    moving_mass_u_kg: float
    wavelength_m: float | None  # in air; None for a motion record, which has no beats
    rest_frequency_hz: Reading = field(default_factory=lambda: NotSeen("no optics"))
    trigger_time_s: float | None = None
    rate_error: float = 0.0  # relative error of the stated sample rate; not included in the stds
    reference: BeatQuality | None = None
    measurement: BeatQuality | None = None
    flags: tuple[str, ...] = ()
    force_measured: bool = False  # True: ``force_n`` was recorded; False: it is mass times acceleration
    plate: Plate | None = None  # as stated in the recording

    def __post_init__(self) -> None:
        for name in ARRAYS:
            getattr(self, name).flags.writeable = False


ARRAYS = tuple(entry.name for entry in fields(Motion) if get_origin(entry.type) is np.ndarray)
