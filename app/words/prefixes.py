"""One unit system: the SI unit with the prefix that leaves a number between 1 and 1000."""

import math

PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M"))


def prefix_for(size: float, unit: str) -> tuple[float, str]:
    """Return (factor, unit) in which ``size``, in the SI ``unit``, is best told: (1e9, "nm") for 3e-8 m."""
    if not math.isfinite(size) or size == 0.0:
        return 1.0, unit
    least = [(scale, prefix) for scale, prefix in PREFIXES if abs(size) >= 0.9995 * scale]
    scale, prefix = least[-1] if least else PREFIXES[0]
    return 1.0 / scale, f"{prefix}{unit}"
