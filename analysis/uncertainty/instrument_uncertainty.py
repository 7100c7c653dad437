"""The uncertainties of the instrument that no shot shows: the type B part of the budget, stated by its owner."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from analysis.shot import PlateTolerance

_RECTANGLE = 1.0 / math.sqrt(3.0)  # standard uncertainty of a limit of which no more is known (GUM 4.3.7)


@dataclass(frozen=True, slots=True)
class InstrumentUncertainty:
    """Standard uncertainties (or, where the name says limit, half-widths of a rectangular distribution).

    ``mass_u_kg``: where the recording's setup states none; 17.85 g read to 0.01 g.
    ``wavelength_vacuum_relative``: a stabilised Zeeman laser without a calibration.
    ``air_*``: sensors near the beam; ``room_*``: a laboratory whose air was not measured.
    ``alignment_limit_rad``: half-angle of the cone in which the beam lies about the motion; with 2 mrad the return beam
    moves by 1 mm over 0.5 m of travel.
    ``timebase_limit``: a digitizer's crystal, 25 ppm.
    ``rest_frequency_u_hz``: where the rest frequency was stated and not recorded.
    ``instant_limit_s``: the shift of one instant of a bounce against another by the band limit.
    """

    mass_u_kg: float = 0.005e-3 * _RECTANGLE
    wavelength_vacuum_relative: float = 1e-7
    air_temperature_u_k: float = 0.2
    air_pressure_u_pa: float = 100.0
    air_humidity_u_percent: float = 5.0
    room_temperature_u_k: float = 2.0
    room_pressure_u_pa: float = 1500.0
    room_humidity_u_percent: float = 15.0
    alignment_limit_rad: float = 2e-3
    timebase_limit: float = 25e-6
    rest_frequency_u_hz: float = 100.0
    instant_limit_s: float = 1e-6
    plate: PlateTolerance = field(default_factory=PlateTolerance)

    def __post_init__(self) -> None:
        for name, value in self._numbers():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be a number that is not negative, not {value!r}")

    def _numbers(self) -> Iterator[tuple[str, float]]:
        for part in (self, self.plate):
            for entry in fields(part):
                value = getattr(part, entry.name)
                if not isinstance(value, PlateTolerance):
                    yield entry.name, float(value)

    @property
    def alignment_u(self) -> float:
        """Get the relative uncertainty from a cosine error of unknown size.

        1/cos a - 1 = a^2/2 is uniform from 0 to its limit for a direction uniform in the cone; it is not corrected, so
        its mean counts as well (GUM F.2.4.5): the root mean square of that distribution.
        """
        return 0.5 * self.alignment_limit_rad**2 * _RECTANGLE

    @property
    def timebase_u(self) -> float:
        return self.timebase_limit * _RECTANGLE

    @property
    def instant_u_s(self) -> float:
        """Get the standard uncertainty in s of an interval's end by the band limit."""
        return self.instant_limit_s * _RECTANGLE
