from . import plate
from .air import STANDARD_AIR, refractive_index, wavelength_in_air_m
from .consistency import CONCERNS, FIT_FLAGS, PLATE_RINGS, concerning, fit_flags, reading_flags
from .disturbance import Disturbance, Shaking, VibrationLine
from .fit import Fit, Overlay, ShotFit, names_on_plate, plates_named
from .impact import Impact, KineticCor
from .motion import BeatQuality, Motion
from .plate import Disc, Number, PlateTolerance, compliance_of, corrected_slope, stated_n_per_m
from .plates_of_set import plate_count, plate_numbers, plates_words, weights_words, why_not_together
from .plot_note import LONGEST, UNITS, PlotNote
from .quantity import NotSeen, Quantity, Reading, shown_in, to_json, words_and_unit
from .recording import (
    AIR,
    DEFAULT_WAVELENGTH_AIR_M,
    NAMES,
    SETUP_CORRECTED,
    Air,
    Channel,
    Gap,
    Plate,
    Recording,
    Role,
    Setup,
    corrected,
)
from .sample_rate_error import DELIVERED, RATE_CONTRADICTED, fit_with_rate_error, rate_error, with_rate_error
from .shot import AnalysisError, AnalysisSettings, Cancelled, Progress, Shot, Stop
from .version import program, program_version

__all__ = [
    "AIR",
    "CONCERNS",
    "DEFAULT_WAVELENGTH_AIR_M",
    "DELIVERED",
    "FIT_FLAGS",
    "LONGEST",
    "NAMES",
    "PLATE_RINGS",
    "RATE_CONTRADICTED",
    "SETUP_CORRECTED",
    "STANDARD_AIR",
    "UNITS",
    "Air",
    "AnalysisError",
    "AnalysisSettings",
    "BeatQuality",
    "Cancelled",
    "Channel",
    "Disc",
    "Disturbance",
    "Fit",
    "Gap",
    "Impact",
    "KineticCor",
    "Motion",
    "NotSeen",
    "Number",
    "Overlay",
    "Plate",
    "PlateTolerance",
    "PlotNote",
    "Progress",
    "Quantity",
    "Reading",
    "Recording",
    "Role",
    "Setup",
    "Shaking",
    "Shot",
    "ShotFit",
    "Stop",
    "VibrationLine",
    "compliance_of",
    "concerning",
    "corrected",
    "corrected_slope",
    "fit_flags",
    "fit_with_rate_error",
    "names_on_plate",
    "plate",
    "plate_count",
    "plate_numbers",
    "plates_named",
    "plates_words",
    "program",
    "program_version",
    "rate_error",
    "reading_flags",
    "refractive_index",
    "shown_in",
    "stated_n_per_m",
    "to_json",
    "wavelength_in_air_m",
    "weights_words",
    "why_not_together",
    "with_rate_error",
    "words_and_unit",
]
