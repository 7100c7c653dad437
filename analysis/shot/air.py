"""The laser's wavelength in air.

Refractive index after P. E. Ciddor, "Refractive index of air: new equations for the visible and near infrared",
Applied Optics 35 (1996) 1566-1573, for 450 ppm of CO2, with the water vapour pressure of Davis/Giacomo used there.
"""

import math

from analysis.shot.recording import DEFAULT_WAVELENGTH_AIR_M, Air, Setup

STANDARD_AIR = Air(temperature_c=20.0, pressure_pa=101325.0, humidity_percent=50.0)


def refractive_index(vacuum_wavelength_m: float, air: Air) -> float:
    """Return the phase refractive index n of moist air (Ciddor 1996, appendix B).

    Valid for 300-1700 nm, -40..100 degC, 80-120 kPa, 0..100 % relative humidity; n(633.0 nm) = 1.000271373 at
    20 degC, 101325 Pa, 50 %.  Raises ValueError outside the range of laboratory air.
    """
    _check(vacuum_wavelength_m, air)
    wavenumber2 = (1e-6 / vacuum_wavelength_m) ** 2  # um^-2
    dry_standard = 1e-8 * (5792105.0 / (238.0185 - wavenumber2) + 167917.0 / (57.362 - wavenumber2))
    vapour_standard = 1.022e-8 * (
        295.235 + 2.6422 * wavenumber2 - 0.032380 * wavenumber2**2 + 0.004028 * wavenumber2**3
    )
    water = _water_fraction(air)
    kelvin = air.temperature_c + 273.15

    # densities in units of molar mass / gas constant, which cancels in the ratios to the reference
    moles = air.pressure_pa / (_compressibility(air.temperature_c, air.pressure_pa, water) * kelvin)
    dry_reference = 101325.0 / (_compressibility(15.0, 101325.0, 0.0) * 288.15)
    vapour_reference = 1333.0 / (_compressibility(20.0, 1333.0, 1.0) * 293.15)
    dry, vapour = moles * (1.0 - water), moles * water
    return 1.0 + dry / dry_reference * dry_standard + vapour / vapour_reference * vapour_standard


def wavelength_in_air_m(setup: Setup) -> float:
    """Return the wavelength in m that converts Doppler cycles into displacement.

    A stated wavelength in air is used as given.  Otherwise a vacuum wavelength is divided by the index of the stated
    air, or of ``STANDARD_AIR`` if none is stated (within a few ppm for a laboratory at 20 degC; vacuum would be 271 ppm
    off).  With neither, the paper's 632.8 nm is used.  Raises ValueError for an impossible wavelength or air.
    """
    if setup.wavelength_air_m is not None:
        if not 1e-7 < setup.wavelength_air_m < 1e-5:
            raise ValueError(f"wavelength_air_m: {setup.wavelength_air_m!r} m is not a wavelength of light")
        return setup.wavelength_air_m
    if setup.wavelength_vacuum_m is not None:
        return setup.wavelength_vacuum_m / refractive_index(setup.wavelength_vacuum_m, setup.air or STANDARD_AIR)
    return DEFAULT_WAVELENGTH_AIR_M


def _check(vacuum_wavelength_m: float, air: Air) -> None:
    for name, value, low, high in (
        ("wavelength_vacuum_m", vacuum_wavelength_m, 3e-7, 1.7e-6),
        ("temperature_c", air.temperature_c, -40.0, 100.0),
        ("pressure_pa", air.pressure_pa, 1e4, 1.4e5),
        ("humidity_percent", air.humidity_percent, 0.0, 100.0),
    ):
        if not low <= value <= high:  # also catches NaN
            raise ValueError(f"{name}: {value!r} lies outside {low:g}..{high:g}, where the index of air is known")


def _water_fraction(air: Air) -> float:
    kelvin = air.temperature_c + 273.15
    saturation_pa = math.exp(1.2378847e-5 * kelvin**2 - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
    enhancement = 1.00062 + 3.14e-8 * air.pressure_pa + 5.6e-7 * air.temperature_c**2
    return air.humidity_percent / 100.0 * enhancement * saturation_pa / air.pressure_pa


def _compressibility(celsius: float, pressure_pa: float, water: float) -> float:
    ratio = pressure_pa / (celsius + 273.15)
    first = 1.58123e-6 - 2.9331e-8 * celsius + 1.1043e-10 * celsius**2
    first += (5.707e-6 - 2.051e-8 * celsius) * water + (1.9898e-4 - 2.376e-6 * celsius) * water**2
    return 1.0 - ratio * first + ratio**2 * (1.83e-11 - 0.765e-8 * water**2)
