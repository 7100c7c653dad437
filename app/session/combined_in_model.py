"""Which uncertainty is which in a model file, with the combined ones beside those of noise alone."""

import math
from collections.abc import Sequence
from statistics import median

from analysis.shot.fit import Fit
from analysis.shot.shot import Shot
from analysis.uncertainty.budget import budget

NOISE_ALONE = "value, and standard uncertainty from noise alone, SI units"
COMBINED = "combined standard uncertainties: noise, and mass, wavelength, air and clock"


def with_combined(text: str, fit: Fit, shots: Sequence[Shot]) -> str:
    """Return a model file's text that says which uncertainty is which, with the combined ones of what has a budget."""
    shared: dict[str, list[float]] = {}
    for shot in shots:
        for q in budget(shot).quantities if shot.impact is not None else ():
            shared.setdefault(q.key, []).append(q.std_b)
    combined = {
        name: math.hypot(quantity.std, float(median(shared[name])))
        for name, quantity in fit.parameters.items()
        if name in shared
    }
    text = text.replace("# value and standard uncertainty, SI units", f"# {NOISE_ALONE}")
    if not combined:
        return text
    lines = [f"{name} = {std!r}" for name, std in combined.items()]
    return "\n".join([text.rstrip("\n"), "", f"[combined_std]  # {COMBINED}", *lines, ""])
