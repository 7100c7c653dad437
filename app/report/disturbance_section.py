"""What moved the path beside the block, as a report tells it: lines, floor, knocks, and what they cost."""

from analysis.shot.disturbance import Disturbance
from analysis.uncertainty.numbers import number_of
from app.report.markup import Markup, joined, table, tag


def disturbance_section(disturbance: Disturbance) -> Markup:
    """Return the section without its heading."""
    floor = (
        f"Site vibration of {1e9 * disturbance.floor_rms_m:.3g} nm and "
        f"{1e6 * disturbance.floor_rms_m_per_s:.3g} µm/s rms is included in the uncertainties."
    )
    parts = [tag("p", floor)]
    if disturbance.lines:
        rows = [
            [str(line.frequency_hz), str(line.amplitude_m.scaled(1e9)), f"{line.phase_rad:.3f}"]
            for line in disturbance.lines
        ]
        parts += [
            tag("p", "Spectral lines present in both flights were removed before the numbers were read:"),
            table(["frequency (Hz)", "amplitude (nm)", "phase at the first sample (rad)"], rows, "numbers"),
        ]
    knocks = ", ".join(f"{1e3 * begin:.1f} to {1e3 * end:.1f} ms" for begin, end in disturbance.knocks_s)
    if knocks:
        parts.append(tag("p", f"Excluded because the table was struck: {knocks} of the record."))
    shares = [f"{100 * share:.0f} % for {number_of(name).words}" for name, share in disturbance.shares.items()]
    if shares:
        parts.append(tag("p", f"Share of the variance due to table vibration: {', '.join(shares)}."))
    return joined(*parts)
