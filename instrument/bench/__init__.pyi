from .digitizer import BenchDigitizer, open_digitizer
from .effects import parse
from .simulated_shots import simulate
from .site import LEVELS_M_PER_S, NAMES, QUIET, USUAL_SITE, site_named

__all__ = [
    "LEVELS_M_PER_S",
    "NAMES",
    "QUIET",
    "USUAL_SITE",
    "BenchDigitizer",
    "open_digitizer",
    "parse",
    "simulate",
    "site_named",
]
