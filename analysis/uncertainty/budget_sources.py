"""The sources of uncertainty of a shot, as variables with name, type and origin, and the instrument's uncertainties.

The instrument's uncertainties cannot be seen in a shot; its owner states them, as the type B part of the budget.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any

from uncertainties import ufloat

from analysis.shot import (
    HP_5518A_VACUUM_M,
    STANDARD_AIR,
    Number,
    Plate,
    PlateTolerance,
    Quantity,
    Reading,
    Setup,
    Shot,
    power_of_second,
    refractive_index,
    wavelength_in_air_m,
)

_STD_OF_RECTANGLE = 1.0 / math.sqrt(3.0)  # standard uncertainty per limit of a rectangular distribution (GUM 4.3.7)


@dataclass(frozen=True, slots=True)
class InstrumentUncertainty:
    """The instrument's standard uncertainties (for names with "limit": half-widths of a rectangular distribution).

    ``mass_u_kg``: used if the recording's set-up states none; 17.85 g read to 0.01 g.
    ``wavelength_vacuum_relative``: a stabilised Zeeman laser without calibration.
    ``air_*``: sensors near the beam; ``room_*``: a laboratory whose air was not measured.
    ``alignment_limit_rad``: half-angle of the cone about the motion in which the beam lies; at 2 mrad the return beam
    moves by 1 mm over 0.5 m of travel.
    ``timebase_limit``: a digitizer's crystal, 25 ppm.
    ``rest_frequency_u_hz``: used if the rest frequency was stated without uncertainty instead of recorded.
    ``instant_limit_s``: shift of one instant of a bounce relative to another, caused by the band limit.
    """

    mass_u_kg: float = 0.005e-3 * _STD_OF_RECTANGLE
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

        For a direction uniform in the cone, 1/cos a - 1 = a^2/2 is uniform from 0 to its limit.  The error is not
        corrected, so its mean counts as well (GUM F.2.4.5): the value is that distribution's root mean square.
        """
        return 0.5 * self.alignment_limit_rad**2 * _STD_OF_RECTANGLE

    @property
    def timebase_u(self) -> float:
        return self.timebase_limit * _STD_OF_RECTANGLE

    @property
    def instant_u_s(self) -> float:
        """Get the standard uncertainty in s of an interval due to the band limit."""
        return self.instant_limit_s * _STD_OF_RECTANGLE


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One source of a result's uncertainty: standard uncertainty u(x), sensitivity dy/dx, and their product.

    ``std`` None: these data do not show the size of the source; it is listed but counts as 0.
    """

    source: str
    kind: str  # "A": evaluated from this measurement's own repeated values; "B": from other information
    std: float | None
    unit: str
    sensitivity: float
    how: str

    @property
    def contribution(self) -> float:
        """Get |dy/dx| u(x) in the unit of the result."""
        return abs(self.sensitivity) * (self.std or 0.0)


class ShotSources:
    """The uncertainty variables of one shot, each made once, so that results sharing a variable are correlated.

    A scale is the ratio of the true value to the value used in the analysis: 1 with an uncertainty.  ``results`` are
    the numbers computed so far, by key.
    """

    def __init__(self, shot: Shot, instrument: InstrumentUncertainty) -> None:
        self.shot = shot
        self.results: dict[str, Number] = {}
        self._rows: dict[Any, BudgetRow] = {}  # variable -> its row, with a sensitivity of 1
        self._instrument = instrument
        self._rate_error = shot.motion.rate_error if shot.motion is not None else 0.0
        self.timebase = self._timebase()
        self.mass_kg, self._mass_value = self._mass()
        self.length_scale = self._length()  # of a displacement; a velocity's scale also has the timebase
        self.velocity_scale = self.length_scale / self.timebase
        self.rest_velocity_m_per_s = self._rest()

    @property
    def mass_scale(self) -> Number:
        """Get the ratio of the block's mass to the value used."""
        return self.mass_kg / self._mass_value

    def number(self, value: float, std: float, name: str, kind: str, unit: str, how: str) -> Number:
        """Return a new independent variable, or the plain value if ``std`` is zero, negative or not finite."""
        if not std > 0.0 or not math.isfinite(std):
            return value
        variable = ufloat(value, std)
        self._rows[variable] = BudgetRow(name, kind, std, unit, 1.0, how)
        return variable

    def row(self, variable: Any, slope: float, size: float) -> BudgetRow:
        """Return the row of a variable by which a result of this ``size`` has the derivative ``slope``."""
        row = replace(self._rows[variable], sensitivity=slope)
        cancels = row.contribution < 1e-15 * size  # up to rounding
        return replace(row, sensitivity=0.0) if cancels else row

    def with_type_a(
        self, reading: Reading | None, name: str, unit: str, *, without_mass: bool = False
    ) -> Number | None:
        """Return a reading with its own type A uncertainty, or None if it was not read.

        The part of a contradicted sample rate, with which the reading scales by the power of time in its ``unit``, is
        removed; ``without_mass`` removes the mass's part.
        """
        if not isinstance(reading, Quantity) or not (math.isfinite(reading.value) and math.isfinite(reading.std)):
            return None
        std = reading.std
        motion = self.shot.motion
        if without_mass and motion is not None:
            carried = reading.value * motion.moving_mass_u_kg / motion.moving_mass_kg
            std = math.sqrt(max(0.0, std**2 - carried**2))
        if self._rate_error:
            carried = power_of_second(unit) * reading.value * self._rate_error
            std = math.sqrt(max(0.0, std**2 - carried**2))
        return self.number(reading.value, std, name, "A", unit, reading.how)

    def interval(self, value_s: float, std_s: float, name: str, how: str) -> Number:
        """Return an interval between two instants, with its noise (type A) and the band limit's shift (type B)."""
        noise = self.number(value_s, std_s, f"beat noise, {name}", "A", "s", how)
        shift = self.number(
            0.0, self._instrument.instant_u_s, f"bandwidth, {name}", "B", "s", "instants shifted alike but for this"
        )
        return (noise + shift) * self.timebase

    def band_scale(self, contact_time: Reading) -> Number:
        """Return the scale of the pulse's height, uncertain by the band limit's largest loss, (1 / (2 T B))^2."""
        motion = self.shot.motion
        if motion is None or not isinstance(contact_time, Quantity) or not contact_time.value > 0.0:
            return 1.0
        lost = (0.5 / contact_time.value / motion.bandwidth_hz) ** 2
        how = f"pulse of {contact_time.value * 1e3:.3g} ms in {motion.bandwidth_hz:g} Hz, rectangular limit"
        return self.number(1.0, lost / math.sqrt(3.0), "bandwidth", "B", "1", how)

    def plate(self, plate: Plate) -> dict[str, Number]:
        """Return a plate's fields and "beam_theory" by name, with the instrument's tolerances."""
        units = {"density_kg_m3": "kg/m3", "youngs_modulus_pa": "Pa"}
        numbers: dict[str, Number] = {}
        for entry in fields(plate):
            name, value = entry.name, getattr(plate, entry.name)
            std = getattr(self._instrument.plate, name)
            words = "plate: " + name.rsplit("_", 1)[0].replace("_", " ")
            numbers[name] = self.number(value, std, words, "B", units.get(name, "m"), "stated tolerance")
        theory = self._instrument.plate.beam_theory
        how = "clamp and disc bend as a plate, not as beams"
        return numbers | {"beam_theory": self.number(1.0, theory, "plate: beam theory", "B", "1", how)}

    def _timebase(self) -> Number:
        stated = self._instrument.timebase_u
        if not self._rate_error:
            return self.number(1.0, stated, "timebase", "B", "1", "digitizer's clock, rectangular limit")
        std = math.hypot(stated, self._rate_error)
        how = "PD0 or the computer's clock contradicts the sample rate by as much"
        return self.number(1.0, std, "timebase", "B", "1", how)

    def _mass(self) -> tuple[Number, float]:
        setup, motion = self.shot.setup, self.shot.motion
        value = motion.moving_mass_kg if motion is not None else setup.moving_mass_kg if setup is not None else 1.0
        stated = max(motion.moving_mass_u_kg if motion else 0.0, setup.moving_mass_u_kg if setup else 0.0)
        if stated > 0.0:
            return self.number(value, stated, "mass", "B", "kg", "stated with the recording"), value
        how = "balance read to 0.01 g (none stated with the recording)"
        return self.number(value, self._instrument.mass_u_kg, "mass", "B", "kg", how), value

    def _length(self) -> Number:
        setup, motion = self.shot.setup, self.shot.motion
        if setup is None or (motion is not None and motion.wavelength_m is None):
            return 1.0  # a motion record, whose length scale is the other instrument's
        alignment = self.number(
            1.0,
            self._instrument.alignment_u,
            "alignment (cosine)",
            "B",
            "1",
            "1/cos a, a uniform in a cone, not corrected",
        )
        return self._wavelength(setup) * alignment

    def _wavelength(self, setup: Setup) -> Number:
        known = self._instrument
        if setup.wavelength_air_m is None and setup.wavelength_vacuum_m is not None:
            used = setup.wavelength_vacuum_m
            std, name, how = used * known.wavelength_vacuum_relative, "wavelength in vacuum", "stabilised laser, stated"
        else:
            used = wavelength_in_air_m(setup)
            std, name = _last_digit(used) / math.sqrt(3.0), "wavelength in air"
            how = f"{used * 1e9:g} nm as stated, rounded to its last digit"
        wavelength = self.number(used, std, name, "B", "m", how)
        return wavelength / used * self._air(setup)

    def _air(self, setup: Setup) -> Number:
        """Return n(assumed air) / n(actual air), linear in temperature, pressure and humidity."""
        known, air = self._instrument, setup.air
        if air is not None:
            stds = (known.air_temperature_u_k, known.air_pressure_u_pa, known.air_humidity_u_percent)
            how = "sensor near the beam"
        else:
            air = STANDARD_AIR
            stds = (known.room_temperature_u_k, known.room_pressure_u_pa, known.room_humidity_u_percent)
            how = "laboratory whose air was not measured"
        wavelength = setup.wavelength_vacuum_m or HP_5518A_VACUUM_M  # it matters little to the sensitivity to air
        here = (air.temperature_c, air.pressure_pa, air.humidity_percent)
        index = refractive_index(wavelength, air)
        scale: Number = 1.0
        names = (("air temperature", "K"), ("air pressure", "Pa"), ("air humidity", "%"))
        for place, ((name, unit), std) in enumerate(zip(names, stds, strict=True)):
            step = 1e-3 * here[place] if here[place] else 1e-3
            moved = type(air)(*(v + step * (i == place) for i, v in enumerate(here)))
            slope = -(refractive_index(wavelength, moved) - index) / step / index
            scale = scale + slope * self.number(0.0, std, name, "B", unit, how)
        return scale

    def _rest(self) -> Number:
        """Return the error in m/s of every velocity from an error of the rest frequency, as a variable around 0."""
        motion = self.shot.motion
        if motion is None or motion.wavelength_m is None:
            return 0.0
        rest = motion.rest_frequency_hz
        if motion.reference is None:
            own = self.shot.setup.rest_frequency_u_hz if self.shot.setup is not None else None
            moved = self._rate_error * rest.value if isinstance(rest, Quantity) else 0.0
            std, kind = math.hypot(own or self._instrument.rest_frequency_u_hz, moved), "B"
            how = "given, not recorded with the shot"
        elif isinstance(rest, Quantity):
            std, kind, how = rest.std, "A", rest.how
        else:
            return 0.0
        return 0.5 * motion.wavelength_m * self.number(0.0, std, "rest frequency", kind, "Hz", how)


def _last_digit(wavelength_m: float) -> float:
    """Return half a unit of the last digit of a stated wavelength, at least 0.05 pm."""
    digits = f"{wavelength_m * 1e9:.6f}".rstrip("0")
    decimals = min(4, max(1, len(digits.split(".")[1])))
    return 0.5e-9 * 10.0**-decimals
