"""Numbers and names as the screen states them: value ± uncertainty in the system's decimal format."""

import math

from PySide6.QtCore import QLocale

from analysis.quantity import NotSeen, Quantity, Reading

DASH = "–"

EFFECT_WORDS = {
    "coulomb_friction": "Coulomb friction on the block",
    "viscous_drag": "viscous drag on the block",
    "quadratic_drag": "quadratic drag on the block",
    "tilt": "a tilt of the guideway",
    "bearing_gradient": "a gradient of the bearing",
    "block_mode": "a mode inside the block",
    "cubic_stiffness": "a cubic stiffness of the plate",
    "plate_damping": "a damping of the plate",
    "viscoelastic_arm": "a viscoelastic arm",
    "second_plate_mode": "a second mode of the plate",
    "support_compliance": "a support that gives",
    "plate_motion": "a plate already swinging at first touch",
    "contact_exponent": "a contact that stiffens with overlap",
    "nonlinear_contact_damping": "a contact damping that grows with overlap",
    "adhesion": "adhesion at release",
    "sensor_drift": "a drift of the measured velocity",
    "demodulation_lag": "a lag of the optics' clock",
    "frame_vibration": "a vibration of the frame",
    "cyclic_error": "a cyclic error of the interferometer",
}

FLAG_WORDS = {
    "clipped": "the digitizer clipped: force and velocity are unsure there; lower the gain or the light",
    "gap": "samples were lost; nothing is shown in their place",
    "truncated": "the file is shorter than its description says; analysed as far as it goes",
    "longer_than_declared": "the file is longer than its description says",
}


def local(text: str) -> str:
    """Return a number written with "." in the system's decimal format."""
    point = QLocale().decimalPoint()
    return text if point == "." else text.replace(".", point)


def number(value: float | None, digits: int = 4) -> str:
    """Return a bare number with so many significant digits, or a dash."""
    if value is None or not math.isfinite(value):
        return DASH
    return local(f"{value:.{digits}g}")


def value_text(reading: Reading | None, scale: float = 1.0) -> str:
    """Return "value ± std" in a unit ``scale`` times smaller than the reading's own, or a dash."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value):
        return DASH
    return local(str(reading.scaled(scale)))


def concise_text(reading: Reading | None, scale: float = 1.0) -> str:
    """Return "0.98756(12)": the digits in brackets are the standard uncertainty of the last ones; or a dash."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value):
        return DASH
    value, std = reading.value * scale, reading.std * abs(scale)
    if not (math.isfinite(std) and std > 0):
        return local(f"{value:.6g}")
    decimals = 1 - math.floor(math.log10(std))
    if decimals <= 0 or decimals > 12:
        return value_text(reading, scale)
    digits = round(std * 10**decimals)
    return local(f"{value:.{decimals}f}({digits})")


def how_text(name: str, reading: Reading | None, meaning: str = "") -> str:
    """Return the hover text: what the number is, how it was read, or why it was not."""
    lines = [f"<b>{name}</b>"]
    if meaning:
        lines.append(meaning)
    if isinstance(reading, Quantity):
        lines.append(f"Read from: {reading.how}" if reading.how else "")
        if reading.std > 0 and math.isfinite(reading.std):
            lines.append("± is the standard uncertainty.")
    elif isinstance(reading, NotSeen):
        lines.append(f"Not seen: {reading.reason}")
    else:
        lines.append("No shot yet.")
    return "<br>".join(line for line in lines if line)


def effect_words(name: str) -> str:
    """Return an effect's name as a person says it."""
    return EFFECT_WORDS.get(name, name.replace("_", " "))


UNIT_ENDINGS = (
    ("_n_s2_per_m2", "N s²/m²"),
    ("_n_s_per_m2", "N s/m²"),
    ("_n_s_per_m", "N s/m"),
    ("_n_per_m3", "N/m³"),
    ("_n_per_m", "N/m"),
    ("_m_per_s2", "m/s²"),
    ("_m_per_s", "m/s"),
    ("_m_per_n", "m/N"),
    ("_kg", "kg"),
    ("_hz", "Hz"),
    ("_rad", "rad"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
)


def parameter_words(name: str, value: Quantity) -> str:
    """Return "coefficient 0.00190 ± 0.00010 N s²/m²" for "coefficient_n_s2_per_m2"."""
    for ending, unit in UNIT_ENDINGS:
        if name.endswith(ending):
            return f"{name.removesuffix(ending).replace('_', ' ')} {value_text(value)} {unit}"
    return f"{name.replace('_', ' ')} {value_text(value)}"


def flag_words(flag: str) -> str:
    """Return what a flag means and what to do, in one line."""
    return FLAG_WORDS.get(flag, flag.replace("_", " "))


def duration(seconds: float) -> str:
    """Return minutes and seconds, "01:05"."""
    whole = max(0, int(seconds))
    return f"{whole // 60:02d}:{whole % 60:02d}"


def room(size_bytes: float) -> str:
    """Return a disk size, "412 GB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000:
            return f"{size_bytes:.0f} {unit}"
        size_bytes /= 1000
    return local(f"{size_bytes:.1f} TB")
