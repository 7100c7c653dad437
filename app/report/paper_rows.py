"""Rows that compare the paper's numbers with this program's, as text in readable units."""

from analysis.paper import PaperRow, Status
from analysis.shot import Quantity

SECTIONS = {
    "input": "Parameters of the paper's rig and simulation",
    "simulation": "The simulation",
    "measurement": "The measurement",
    "plate": "The plate",
    "instrument": "The instrument",
}
SCALES = {"s": (1e3, "ms"), "m": (1e3, "mm"), "kg": (1e3, "g"), "Pa": (1e-9, "GPa"), "1": (1.0, "")}
OWN_SCALES = {"wavelength": (1e9, "nm"), "record_length": (1.0, "s"), "input.step_s": (1e9, "ns")}


def cells(row: PaperRow) -> tuple[str, ...]:
    """Return a row as text: what, paper, as printed, simulated, recomputed, recording, difference and status."""
    said = row.paper_words or shown(row, row.paper) or "–"
    unit = readable_unit(row)[1].replace("m3", "m³")
    what = f"{row.what} ({unit})" if unit else row.what
    recorded = str(row.recorded.scaled(readable_unit(row)[0])) if isinstance(row.recorded, Quantity) else ""
    if row.status in (Status.INPUT, Status.ADDED):
        difference = row.status.value
    else:
        before, after = (shown(row, error, relative=True) for error in (row.error_before, row.error_after))
        change = before if row.error_before == row.error_after else f"{before} → {after or '–'}"
        difference = f"{change} {row.status.value}"
    numbers = (shown(row, value) for value in (row.printed, row.simulated, row.recomputed))
    return what, said, *numbers, recorded, difference


def shown(row: PaperRow, value: float | None, *, relative: bool = False) -> str:
    """Return a number of a row in its readable unit, or a relative difference in per cent; empty for None."""
    if value is None:
        return ""
    if relative:
        if value > 2.0:
            return f"×{value + 1.0:.{0 if value > 99.0 else 1}f}"
        if abs(value) < 5e-7:
            return "none"
        return f"{value * 1e6:+.0f} ppm" if abs(value) < 5e-4 else f"{value * 100.0:+.2g} %"
    return f"{value * readable_unit(row)[0]:.7g}"


def readable_unit(row: PaperRow) -> tuple[float, str]:
    """Return the factor from SI to the readable unit, and that unit."""
    return OWN_SCALES.get(row.key) or SCALES.get(row.unit, (1.0, row.unit))
