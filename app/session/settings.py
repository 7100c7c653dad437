"""Declare and check all settings of the window, in SI units: rig, shot, light switch, analysis, folders."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from platformdirs import user_documents_path

from analysis.collision import PAPER
from analysis.planning import ADDED_KG, SPEEDS_M_PER_S, Reach
from analysis.shot import HP_5518A_VACUUM_M, Setup, corrected_setup
from analysis.shot import SETUP_KEYS as RIG_VALUES
from instrument.bench import LEVELS_M_PER_S, NAMES, USUAL_SITE
from instrument.capture import CaptureOptions
from instrument.devices import CaptureSettings, Digitizer, DigitizerError, network_source, source_of
from instrument.files import shown
from instrument.trigger import Edge
from levimass import (
    AnalysisChoices,
    AnalysisSettings,
    Setting,
    Value,
    choice,
    declared,
    flag,
    number,
    setting_of,
    settings_of,
)

MAX_ADDRESSES = 5


class WrongSettings(Exception):
    """Invalid settings; the message says why in one line."""


SITES = tuple(
    (name, f"{name} ({LEVELS_M_PER_S[name] * 1e6:.3g} µm/s)" if name in LEVELS_M_PER_S else name) for name in NAMES
)
RIG, AIR, SHOT, SWITCH, _, BENCH, LOOKS, TRIGGER, NEXT = GROUPS = (
    *("The rig", "Air in the beam path", "The shot", "Light switch", "Analysis", "Simulated bench"),
    *("Folders and appearance", "At the trigger", "The next shot"),
)

_EDGES = {edge.name.lower(): edge for edge in (Edge.EITHER, Edge.RISING, Edge.FALLING)}


# fmt: off
@dataclass(frozen=True, slots=True)
class Settings(AnalysisChoices):
    """All settings, None if not given.  Fields without a declaration are state that the window stores itself."""

    moving_mass_kg: float = number(PAPER.block_mass_kg, RIG, "Moving mass", "g", 1e3, 1e-4, 100.0,
        "Block with corner cube and extension; force and impulse scale with it")
    moving_mass_u_kg: float = number(1e-6, RIG, "Mass uncertainty", "mg", 1e6, 0.0, 1.0,
        "Standard uncertainty of the mass")
    wavelength_vacuum_m: float | None = number(HP_5518A_VACUUM_M, RIG, "Wavelength in vacuum", "nm", 1e9, 200e-9, 3e-6,
        f"HP 5518A: {1e9 * HP_5518A_VACUUM_M:.6f} nm. With the air given, the wavelength in air is computed from it",
        optional=True)
    wavelength_air_m: float | None = number(None, RIG, "Wavelength in air", "nm", 1e9, 200e-9, 3e-6,
        "If given, it overrides the value computed from vacuum wavelength and air. Velocity and force scale with it")
    rest_frequency_hz: float | None = number(None, RIG, "Rest frequency", "MHz", 1e-6, 1e3, 1e9,
        "Needed only without PD0")
    temperature_c: float | None = number(None, AIR, "Temperature", "°C", 1.0, -40.0, 100.0,
        "1 K changes the wavelength by 0.95 ppm")
    pressure_pa: float | None = number(None, AIR, "Pressure", "hPa", 1e-2, 1e4, 1.4e5,
        "1 hPa changes the wavelength by 0.27 ppm")
    humidity_percent: float | None = number(None, AIR, "Relative humidity", "%", 1.0, 0.0, 100.0,
        "10 % change the wavelength by 0.09 ppm")
    sample_rate_hz: float = number(10e6, SHOT, "Sample rate", "MS/s", 1e-6, 1e3, 1e10,
        "The digitizer's nearest sample rate is used")
    duration_s: float = number(0.15, SHOT, "Length", "ms", 1e3, 1e-3, 100.0,
        "Long enough for both flights: the contact lasts about 29 ms")
    pre_trigger_s: float = number(6e-3, SHOT, "Pre-trigger time", "ms", 1e3, 0.0, 100.0,
        "Samples recorded before the light switch")
    edge: str = choice("either", SWITCH, "Edge", [(name, name) for name in _EDGES],
        "Which step of the light switch starts the shot")
    switch_low_v: float | None = number(None, SWITCH, "Low threshold", "V", 1.0, -100.0, 100.0,
        "Empty: determined from the signal")
    switch_high_v: float | None = number(None, SWITCH, "High threshold", "V", 1.0, -100.0, 100.0,
        "Empty: determined from the signal")
    site: str = choice(USUAL_SITE, BENCH, "Site (floor vibration)", SITES, "Floor vibration under the simulated bench: "
        "the vibration criteria of the field, as the rms velocity in a third-octave")
    folder: str = declared("", Setting(LOOKS, "Recordings", "folder",
        hover="Where shots are saved; empty: Levimass in your documents"))
    appearance: str = choice("system", LOOKS, "Colours",
        (("system", "as the system"), ("light", "light"), ("dark", "dark")), "Dark or light")
    sound: bool = flag(False, TRIGGER, "a sound", "The system's own sound when the light switch fires")
    flash: bool = flag(False, TRIGGER, "a flash of the banner",
        "The banner flashes once when the light switch fires")
    speeds_m_per_s: str = declared(" ".join(map(str, SPEEDS_M_PER_S)), Setting(NEXT, "Speeds", "numbers",
        "m/s", 1.0, 1e-3, 10.0,
        "Impact speeds that the rig can produce; a planned shot uses one of them. Separate with spaces"))
    weights_kg: str = declared(" ".join(str(kg) for kg in ADDED_KG if kg), Setting(NEXT, "Weights", "numbers",
        "g", 1e3, 1e-4, 100.0,
        "Masses that can be added to the block; a planned shot uses one or none. Empty: none",
        optional=True))
    run_up_m: float = number(Reach().run_up_m, NEXT, "Run-up", "mm", 1e3, 1e-4, 10.0,
        "Length of free flight before the plate that can be recorded")
    source: str = "bench"
    network: str = ""  # addresses of oscilloscopes, newest first, separated by blanks
    tour_done: bool = False
    session: str = ""  # path of the open session if it has a name
    recent: str = ""  # recently opened files, newest first, one per line
    window: str = ""  # geometry and view, see ``app.window.panels.layout``
    # fmt: on

    def __post_init__(self) -> None:
        air = (self.temperature_c, self.pressure_pa, self.humidity_percent)
        if any(value is None for value in air) and any(value is not None for value in air):
            raise WrongSettings("air: give temperature, pressure and humidity, or none of them")
        if (self.switch_low_v is None) != (self.switch_high_v is None):
            raise WrongSettings("light switch: give both thresholds, or neither")
        for field in fields(self):
            value, setting = getattr(self, field.name), setting_of(field)
            try:
                if setting is not None:
                    setting.check(value)
                elif type(value) is not type(field.default):
                    raise WrongSettings(f"{field.name}: {shown(value)} is not a {type(field.default).__name__}")
            except ValueError as error:
                raise WrongSettings(str(error)) from None
        if self.switch_low_v is not None and self.switch_high_v is not None and self.switch_low_v >= self.switch_high_v:
            raise WrongSettings("light switch: the low threshold must be below the high one")
        if self.pre_trigger_s >= self.duration_s:
            raise WrongSettings("the pre-trigger part must be shorter than the shot")

    @property
    def reach(self) -> Reach:
        """Get the rig's possible speeds, added masses (including none) and run-up for a planned shot."""
        speeds, weights = (sorted(set(map(float, text.split()))) for text in (self.speeds_m_per_s, self.weights_kg))
        return Reach(tuple(speeds), (0.0, *weights), self.run_up_m)

    @property
    def data_folder(self) -> Path:
        return Path(self.folder).expanduser() if self.folder else user_documents_path() / "Levimass"

    @property
    def network_sources(self) -> tuple[str, ...]:
        """Get the sources of known network oscilloscopes, newest first; invalid addresses are left out."""
        sources = []
        for text in self.network.split()[:MAX_ADDRESSES]:
            with contextlib.suppress(DigitizerError):
                sources.append(network_source(text))
        return tuple(sources)

    @property
    def analysis(self) -> AnalysisSettings:
        return AnalysisSettings(**{field.name: getattr(self, field.name) for field in fields(AnalysisChoices)})

    @property
    def setup(self) -> Setup:
        """Get the description of the rig, for sources that do not provide one."""
        return corrected_setup(Setup(self.moving_mass_kg), {name: getattr(self, name) for name in RIG_VALUES})

    def options(self, source: str, digitizer: Digitizer) -> CaptureOptions:
        """Return the capture options for a source, at its nearest sample rate; creates the data folder."""
        folder = self.data_folder
        folder.mkdir(parents=True, exist_ok=True)
        settings = digitizer.default_settings()
        if settings is None:
            able = digitizer.capabilities
            rate = min(able.rates_hz, key=lambda r: abs(r - self.sample_rate_hz), default=self.sample_rate_hz)
            samples = round(self.duration_s * rate)
            if able.max_samples is not None:
                samples = min(samples, able.max_samples)
            settings = CaptureSettings(rate, samples, min(round(self.pre_trigger_s * rate), samples - 1))
        knows = source_of(source).states_setup
        setup = None if knows else replace(self.setup, digitizer_bits=digitizer.capabilities.bits)
        return CaptureOptions(folder, settings, setup, _EDGES[self.edge], self.switch_low_v, self.switch_high_v)

    def values(self) -> dict[str, Value]:
        """Return all settings by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


FIELDS = tuple(sorted((s for s in settings_of(Settings) if s.group), key=lambda s: GROUPS.index(s.group)))


def correction_words(corrections: Sequence[tuple[str, float | None]]) -> list[str]:
    """Return the corrected values of the rig in words, each like "moving mass 17.9 g"."""
    given = {name: value for name, value in corrections if value is not None}
    return [
        f"{field.words[0].lower()}{field.words[1:]} {given[field.key] * field.scale:.10g} {field.unit}".rstrip()
        for field in FIELDS
        if field.key in given and field.key != "moving_mass_u_kg"
    ]
