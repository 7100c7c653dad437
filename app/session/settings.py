"""What a person may choose: the rig, the shot, the analysis, the folders; checked as a whole, in SI units."""

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from platformdirs import user_documents_path

from analysis.planning.next_shot import ADDED_KG, SPEEDS_M_PER_S, Reach
from analysis.shot.recording import Air, Setup
from analysis.shot.shot import AnalysisSettings
from app.session.setting_field import Field, Value
from instrument.bench.site import LEVELS_M_PER_S, NAMES, USUAL_SITE
from instrument.capture_options import CaptureOptions
from instrument.digitizer import CaptureSettings, Digitizer, DigitizerError
from instrument.network_scope import network_source
from instrument.recording_error import shown
from instrument.trigger import Edge

KNOWS_ITS_RIG = ("bench", "replay")  # sources that bring mass and wavelength along
MOST_ADDRESSES = 5
MOST_LISTED = 12  # speeds or weights: each pair is foretold by every model that competes


class WrongSettings(Exception):
    """What does not go together, in one line."""


@dataclass(frozen=True, slots=True)
class Settings:
    """All choices; None where a thing is not given."""

    moving_mass_kg: float = 17.85e-3
    moving_mass_u_kg: float = 1e-6
    wavelength_vacuum_m: float | None = 632.991354e-9
    wavelength_air_m: float | None = None
    temperature_c: float | None = None
    pressure_pa: float | None = None
    humidity_percent: float | None = None
    rest_frequency_hz: float | None = None
    sample_rate_hz: float = 10e6
    duration_s: float = 0.15
    pre_trigger_s: float = 6e-3
    edge: str = "either"
    switch_low_v: float | None = None
    switch_high_v: float | None = None
    bandwidth_hz: float = 10e3
    model: str = "paper"
    rest: str = "smoothed"
    speeds_m_per_s: str = " ".join(map(str, SPEEDS_M_PER_S))  # that a planned shot may have
    weights_kg: str = " ".join(str(kg) for kg in ADDED_KG if kg)  # that it may have on the block
    run_up_m: float = 12e-3
    folder: str = ""
    sound: bool = False  # at the trigger
    flash: bool = False
    appearance: str = "system"
    source: str = "bench"
    site: str = USUAL_SITE  # of the simulated bench
    network: str = ""  # oscilloscopes in the network that answered, newest first, blanks between them
    tour_done: bool = False
    session: str = ""  # the named one that is open
    recent: str = ""  # recordings and sessions opened lately, newest first, a line each
    window: str = ""  # how it was left: ``app.window.window_state``

    def __post_init__(self) -> None:
        air = (self.temperature_c, self.pressure_pa, self.humidity_percent)
        if any(value is None for value in air) and any(value is not None for value in air):
            raise WrongSettings("air: give temperature, pressure and humidity, or none of them")
        if (self.switch_low_v is None) != (self.switch_high_v is None):
            raise WrongSettings("light switch: give both thresholds, or neither")
        if self.switch_low_v is not None and self.switch_high_v is not None and self.switch_low_v >= self.switch_high_v:
            raise WrongSettings("light switch: the low threshold must lie below the high one")
        if self.pre_trigger_s >= self.duration_s:
            raise WrongSettings("the pre-trigger part must be shorter than the shot")
        if not isinstance(self.tour_done, bool):
            raise WrongSettings(f"tour_done: {shown(self.tour_done)} is neither true nor false")
        for key in ("source", "network", "session", "recent", "window"):
            if not isinstance(getattr(self, key), str):
                raise WrongSettings(f"{key}: {shown(getattr(self, key))} is not a text")
        for field in FIELDS:
            value = getattr(self, field.key)
            if field.kind == "number":
                if value is None and field.optional:
                    continue
                if (
                    isinstance(value, bool)
                    or not isinstance(value, int | float)
                    or not field.low <= value <= field.high
                ):
                    raise WrongSettings(f"{field.words}: {shown(value)} is outside {field.low:g} to {field.high:g}")
            elif field.kind == "numbers":
                self._check_list(field, value)
            elif field.kind == "choice" and value not in {stored for stored, _ in field.choices}:
                raise WrongSettings(f"{field.words}: {shown(value)} is none of the choices")
            elif field.kind == "flag":
                if not isinstance(value, bool):
                    raise WrongSettings(f"{field.words}: {shown(value)} is neither true nor false")
            elif not isinstance(value, str):
                raise WrongSettings(f"{field.words}: {shown(value)} is not a text")

    def _check_list(self, field: Field, value: Value) -> None:
        try:
            numbers = [float(word) for word in value.split()] if isinstance(value, str) else None
        except ValueError:
            numbers = None
        if numbers is None:
            raise WrongSettings(f"{field.words}: {shown(value)} is no list of numbers")
        if not numbers and not field.optional:
            raise WrongSettings(f"{field.words}: a number is missing")
        if len(numbers) > MOST_LISTED:
            raise WrongSettings(f"{field.words}: {len(numbers)} numbers, of which a plan can weigh {MOST_LISTED}")
        for number in numbers:
            if not field.low <= number <= field.high:
                raise WrongSettings(f"{field.words}: {number:g} is outside {field.low:g} to {field.high:g}")

    @property
    def reach(self) -> Reach:
        """Get what the rig can do, for the planning of a next shot: its speeds, its weights and none, its run-up."""
        speeds, weights = (sorted(set(map(float, text.split()))) for text in (self.speeds_m_per_s, self.weights_kg))
        return Reach(tuple(speeds), (0.0, *weights), self.run_up_m)

    @property
    def data_folder(self) -> Path:
        """Get where shots are saved."""
        return Path(self.folder).expanduser() if self.folder else user_documents_path() / "Levimass"

    @property
    def network_sources(self) -> tuple[str, ...]:
        """Get the oscilloscopes in the network that answered before, newest first; what is no address is left out."""
        sources = []
        for text in self.network.split()[:MOST_ADDRESSES]:
            with contextlib.suppress(DigitizerError):
                sources.append(network_source(text))
        return tuple(sources)

    @property
    def analysis(self) -> AnalysisSettings:
        """Get what concerns the analysis."""
        return AnalysisSettings(bandwidth_hz=self.bandwidth_hz, model=self.model, rest=self.rest)

    @property
    def setup(self) -> Setup:
        """Get the rig, for sources that do not know it."""
        air = None
        if self.temperature_c is not None and self.pressure_pa is not None and self.humidity_percent is not None:
            air = Air(self.temperature_c, self.pressure_pa, self.humidity_percent)
        return Setup(
            moving_mass_kg=self.moving_mass_kg,
            moving_mass_u_kg=self.moving_mass_u_kg,
            wavelength_vacuum_m=self.wavelength_vacuum_m,
            wavelength_air_m=self.wavelength_air_m,
            air=air,
            rest_frequency_hz=self.rest_frequency_hz,
        )

    def options(self, source: str, digitizer: Digitizer) -> CaptureOptions:
        """Return how shots are taken with a source; a rate it does not have becomes its nearest.

        The folder is made here, as the capture asks for one that exists.
        """
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
        knows = re.split("[:?]", source, maxsplit=1)[0] in KNOWS_ITS_RIG
        setup = None if knows else replace(self.setup, digitizer_bits=digitizer.capabilities.bits)
        edge = {"rising": Edge.RISING, "falling": Edge.FALLING}.get(self.edge, Edge.EITHER)
        return CaptureOptions(folder, settings, setup, edge, self.switch_low_v, self.switch_high_v)

    def values(self) -> dict[str, Value]:
        """Return all choices by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def with_values(self, values: dict[str, Value]) -> "Settings":
        """Return the settings with some choices changed.  Raises WrongSettings."""
        try:
            return replace(self, **values)  # type: ignore[arg-type]
        except TypeError as error:
            raise WrongSettings(f"unknown setting: {error}") from None


SITES = tuple(
    (name, f"{name} ({LEVELS_M_PER_S[name] * 1e6:.3g} µm/s)" if name in LEVELS_M_PER_S else name) for name in NAMES
)
FIELDS: tuple[Field, ...] = (
    Field("moving_mass_kg", "The rig", "Moving mass", "number", "g", 1e3, 1e-4, 100.0,
          "Block with corner cube and extension; force and impulse scale with it"),
    Field("moving_mass_u_kg", "The rig", "its uncertainty", "number", "mg", 1e6, 0.0, 1.0,
          "Standard uncertainty of the mass"),
    Field("wavelength_vacuum_m", "The rig", "Wavelength in vacuum", "number", "nm", 1e9, 200e-9, 3e-6,
          "HP 5518A: 632.991354 nm. With the air given, the wavelength in air follows from it", optional=True),
    Field("wavelength_air_m", "The rig", "Wavelength in air", "number", "nm", 1e9, 200e-9, 3e-6,
          "Given, it is used as it is. Velocity and force scale with it", optional=True),
    Field("rest_frequency_hz", "The rig", "Rest frequency", "number", "MHz", 1e-6, 1e3, 1e9,
          "Only where there is no PD0", optional=True),
    Field("temperature_c", "Air in the beam path", "Temperature", "number", "°C", 1.0, -40.0, 100.0,
          "1 K changes the wavelength by 0.95 ppm", optional=True),
    Field("pressure_pa", "Air in the beam path", "Pressure", "number", "hPa", 1e-2, 1e4, 1.4e5,
          "1 hPa changes the wavelength by 0.27 ppm", optional=True),
    Field("humidity_percent", "Air in the beam path", "Relative humidity", "number", "%", 1.0, 0.0, 100.0,
          "10 % change the wavelength by 0.09 ppm", optional=True),
    Field("sample_rate_hz", "The shot", "Sample rate", "number", "MS/s", 1e-6, 1e3, 1e10,
          "The nearest rate the digitizer has is taken"),
    Field("duration_s", "The shot", "Length", "number", "ms", 1e3, 1e-3, 100.0,
          "Long enough for both flights: the contact lasts about 29 ms"),
    Field("pre_trigger_s", "The shot", "before the light switch", "number", "ms", 1e3, 0.0, 100.0,
          "Samples recorded before the light switch"),
    Field("edge", "Light switch", "Edge", "choice", choices=(
        ("either", "either"), ("rising", "rising"), ("falling", "falling")),
          hover="Which step of the light switch starts the shot"),
    Field("switch_low_v", "Light switch", "Low threshold", "number", "V", 1.0, -100.0, 100.0,
          "Empty: determined from the signal", optional=True),
    Field("switch_high_v", "Light switch", "High threshold", "number", "V", 1.0, -100.0, 100.0,
          "Empty: determined from the signal", optional=True),
    Field("bandwidth_hz", "Analysis", "Bandwidth", "number", "kHz", 1e-3, 10.0, 1e6,
          "Of velocity and force; noise of force grows with its power 2.5"),
    Field("model", "Analysis", "Base model", "choice", choices=(
        ("paper", "paper (two bodies)"), ("clamped", "damping clamped"), ("no_tension", "no tension"),
        ("contact", "one body on a spring"), ("driven", "driven slider")),
          hover="What is simulated and fitted. Paper: block and plate, damped both ways, pulling until the overlap is "
          "gone; damping clamped: none while they part, as Eq. 10 is printed; no tension: the contact never pulls"),
    Field("rest", "Analysis", "Rest beat", "choice", choices=(
        ("smoothed", "smoothed PD0"), ("instantaneous", "instantaneous PD0")),
          hover="How PD0 is subtracted from PD1"),
    Field("site", "Simulated bench", "stands at", "choice", choices=SITES,
          hover="How much the floor under the simulated bench moves: the vibration criteria of the field, "
          "as the rms velocity in a third-octave"),
    Field("folder", "Folders and appearance", "Recordings", "folder",
          hover="Where shots are saved; empty: Levimass in your documents"),
    Field("appearance", "Folders and appearance", "Colours", "choice", choices=(
        ("system", "as the system"), ("light", "light"), ("dark", "dark")), hover="Dark or light"),
    Field("sound", "At the trigger", "a sound", "flag",
          hover="The system's own sound when the light switch fires"),
    Field("flash", "At the trigger", "a flash of the banner", "flag",
          hover="The banner flashes once when the light switch fires"),
    Field("speeds_m_per_s", "The next shot", "Speeds", "numbers", "m/s", 1.0, 1e-3, 10.0,
          "Speeds at which you can let the block strike; a planned shot is one of them. Blanks part them"),
    Field("weights_kg", "The next shot", "Weights", "numbers", "g", 1e3, 1e-4, 100.0,
          "What can be put on the block, each as a whole; a planned shot has one of them or none. Empty: none at hand",
          optional=True),
    Field("run_up_m", "The next shot", "Run-up", "number", "mm", 1e3, 1e-4, 10.0,
          "Free flight before the plate: so much of it can be recorded"),
)  # fmt: skip


def correction_words(corrections: Sequence[tuple[str, float | None]]) -> list[str]:
    """Return values of the rig that were put right, each as "moving mass 17.9 g"; what is not given is left out."""
    given = {name: value for name, value in corrections if value is not None}
    return [
        f"{field.words[0].lower()}{field.words[1:]} {given[field.key] * field.scale:.10g} {field.unit}".rstrip()
        for field in FIELDS
        if field.key in given and field.key != "moving_mass_u_kg"
    ]
