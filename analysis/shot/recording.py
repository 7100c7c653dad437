"""A raw shot: the digitizer's counts and the set-up they were recorded with."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

DEFAULT_WAVELENGTH_AIR_M = 632.8e-9  # the paper's; 30 ppm below Ciddor's for 20 degC, 101325 Pa, 50 % RH
HP_5518A_VACUUM_M = 632.991354e-9  # wavelength of that laser in vacuum
MAX_GAPS = 300
_NOTHING: Mapping[str, Any] = MappingProxyType({})


class Role(StrEnum):
    REFERENCE = "reference"  # PD0: the rest beat
    MEASUREMENT = "measurement"  # PD1: the beat shifted by the moving corner cube
    SWITCH = "switch"  # the light switch that the block crosses


@dataclass(frozen=True, slots=True)
class Channel:
    """One digitizer channel; volts = counts * volts_per_count + offset_v."""

    role: Role
    volts_per_count: float
    offset_v: float = 0.0


@dataclass(frozen=True, slots=True)
class Air:
    temperature_c: float
    pressure_pa: float
    humidity_percent: float


@dataclass(frozen=True, slots=True)
class Plate:
    """Geometry and material of the spring plate: an arm with a disc at its free end."""

    arm_length_m: float
    arm_width_m: float
    thickness_m: float
    disc_diameter_m: float
    density_kg_m3: float
    youngs_modulus_pa: float


@dataclass(frozen=True, slots=True)
class Setup:
    """The set-up of a shot; ``extra`` keeps keys of other programs, so that they are written back."""

    moving_mass_kg: float
    moving_mass_u_kg: float = 0.0
    wavelength_vacuum_m: float | None = None
    wavelength_air_m: float | None = None
    air: Air | None = None
    rest_frequency_hz: float | None = None
    plate: Plate | None = None
    digitizer_bits: int = 16
    rest_frequency_u_hz: float | None = None  # standard uncertainty of the stated rest frequency
    extra: Mapping[str, Any] = field(default_factory=lambda: _NOTHING)


@dataclass(frozen=True, slots=True)
class Gap:
    """Samples lost between stored samples ``sample_start - 1`` and ``sample_start``; None: number unknown."""

    sample_start: int
    samples_lost: int | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A raw shot.

    ``counts`` is int16, shape (samples, channels), read-only; time zero is the first sample.
    ``flags`` are the recording's known faults ("clipped", "gap", "truncated", "longer_than_declared", ...).
    """

    name: str
    counts: NDArray[np.int16]
    sample_rate_hz: float
    channels: tuple[Channel, ...]
    setup: Setup
    trigger_sample: int | None = None
    gaps: tuple[Gap, ...] = ()
    started_at: str | None = None  # ISO 8601, UTC
    note: str = ""
    flags: tuple[str, ...] = ()
    path: str | None = None
    extra: Mapping[str, Any] = field(default_factory=lambda: _NOTHING)  # metadata of other programs, kept unchanged

    @property
    def samples(self) -> int:
        """Get the number of samples per channel."""
        return int(self.counts.shape[0])

    @property
    def trigger_time_s(self) -> float | None:
        """Get the time in s from the first sample to the light switch."""
        return None if self.trigger_sample is None else self.trigger_sample / self.sample_rate_hz

    @property
    def bridgeable_gaps(self) -> tuple[Gap, ...]:
        """Get the gaps inside the recording that lost samples, in order.

        Once the losses exceed the stored samples, later gaps count as of unknown length: motion cannot be predicted
        over them, and a few bytes of metadata must not claim more memory than the samples.  With more than
        ``MAX_GAPS`` all do, as the stretches between are too short to be read and each gap costs 4 ms.
        """
        inside = (gap for gap in self.gaps if 0 < gap.sample_start < self.samples and gap.samples_lost != 0)
        gaps, lost = [], 0
        for gap in sorted(inside, key=lambda gap: gap.sample_start):
            lost += gap.samples_lost or 0
            gaps.append(gap if lost <= self.samples else Gap(gap.sample_start))
        return tuple(gaps) if len(gaps) <= MAX_GAPS else tuple(Gap(gap.sample_start) for gap in gaps)

    def column(self, role: Role) -> int | None:
        """Return the index of the channel with this role, or None."""
        for index, channel in enumerate(self.channels):
            if channel.role is role:
                return index
        return None

    def counts_of(self, role: Role) -> NDArray[np.int16]:
        """Return the counts, shape (samples,), of the channel with this role, which the recording must have."""
        column = self.column(role)
        assert column is not None
        return self.counts[:, column]


SETUP_CORRECTED = "setup_corrected"
AIR = ("temperature_c", "pressure_pa", "humidity_percent")
SETUP_KEYS = (
    "moving_mass_kg",
    "moving_mass_u_kg",
    "wavelength_vacuum_m",
    "wavelength_air_m",
    "rest_frequency_hz",
    *AIR,
)


def corrected_setup(setup: Setup, corrections: Mapping[str, float | None]) -> Setup:
    """Return the set-up with these values (SI units) in place of its own; None: not given.

    Names are those of ``SETUP_KEYS``; the air changes only when all of ``AIR`` are given.  Raises KeyError for another
    name.
    """
    unknown = set(corrections) - set(SETUP_KEYS)
    if unknown:
        raise KeyError(sorted(unknown)[0])
    plain = {name: value for name, value in corrections.items() if name not in AIR}
    if set(AIR) <= set(corrections):
        air = [value for name in AIR if (value := corrections[name]) is not None]
        plain["air"] = Air(*air) if len(air) == len(AIR) else None  # type: ignore[assignment]
    return replace(setup, **plain)  # type: ignore[arg-type]
