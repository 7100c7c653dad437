"""What was entered wrongly when a shot was taken, put right afterwards: the recording itself stays as it is."""

from collections.abc import Mapping
from dataclasses import replace

from analysis.shot.recording import Air, Setup

FLAG = "setup_corrected"
AIR = ("temperature_c", "pressure_pa", "humidity_percent")
NAMES = ("moving_mass_kg", "moving_mass_u_kg", "wavelength_vacuum_m", "wavelength_air_m", "rest_frequency_hz", *AIR)


def corrected(setup: Setup, corrections: Mapping[str, float | None]) -> Setup:
    """Return the rig with these values, in SI units, in place of its own; None: not given.

    Names are those of ``NAMES``; the air is corrected as a whole.  Raises KeyError for another name.
    """
    unknown = set(corrections) - set(NAMES)
    if unknown:
        raise KeyError(sorted(unknown)[0])
    plain = {name: value for name, value in corrections.items() if name not in AIR}
    if set(AIR) <= set(corrections):
        air = [value for name in AIR if (value := corrections[name]) is not None]
        plain["air"] = Air(*air) if len(air) == len(AIR) else None  # type: ignore[assignment]
    return replace(setup, **plain)  # type: ignore[arg-type]
