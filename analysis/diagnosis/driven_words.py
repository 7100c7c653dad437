"""What a diagnosis of a drive says to a person."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.result import FoundEffect
from analysis.diagnosis.words import quantity, stem
from analysis.drive import LAWS, Law, MassCheck, Regression, Repeatability, Table, rms
from analysis.shot import Quantity

Floats = NDArray[np.float64]


def sentence(
    effects: Sequence[FoundEffect],
    before: Regression,
    after: Regression,
    held_n: float,
    repeatability: Repeatability,
    mass_check: MassCheck,
) -> str:
    """Return the verdict's sentence: what was found, the error before and after, and what the drive repeats to."""
    times = after.rms_n / repeatability.force_n if repeatability.force_n > 0.0 else float("inf")
    against = f"{after.rms_n:.3g} N is {times:.2g} times {repeatability.what} ({repeatability.force_n:.2g} N)"
    if effects:
        listed = "; ".join(effect.sentence for effect in effects)
        text = (
            f"The drive has {listed}. Force error {before.rms_n:.3g} -> {after.rms_n:.3g} N rms, "
            f"{held_n:.3g} N on the validation half; {against}."
        )
    elif times <= 1.5:
        text = f"Adequate: mass, viscous drag and offset leave nothing to speak of; {against}."
    else:
        text = f"Unexplained: {before.rms_n:.3g} N rms remain and no law of the catalogue predicts them; {against}."
    return f"{text} {mass_check.words}".strip()


def effect(law: Law, parameters: Mapping[str, Quantity], found: Regression, others: Sequence[Law]) -> str:
    """Return what one law is in this drive, in words and numbers."""
    numbers = ", ".join(f"{stem(name)} {quantity(name, value)}" for name, value in parameters.items())
    alike = f" (as well: {', '.join(other.short_words for other in others)})" if others else ""
    return f"{law.short_words}, {law.formula}: {numbers}{_meaning(law.name, parameters, found)}{alike}"


def _meaning(law: str, parameters: Mapping[str, Quantity], found: Regression) -> str:
    if law == "stribeck_friction":
        sliding = found.quantity("coulomb_friction.force_n").value if "coulomb_friction" in found.laws else 0.0
        at_rest = sliding + parameters["force_n"].value
        way = "rises" if parameters["force_n"].value > 0.0 else "falls, against Stribeck's sign,"
        speed = 1e3 * parameters["speed_m_per_s"].value
        return f": friction {way} from {sliding:.3g} to {at_rest:.3g} N towards rest, below some {speed:.2g} mm/s"
    if law == "drive_delay":
        late = parameters["time_s"].value
        way = "later" if late > 0.0 else "before it is told"
        return f": the motion answers the force {1e3 * abs(late):.2g} ms {way}"
    if law == "directional_viscous_drag":
        drag, more = found.quantity("viscous_coefficient_n_s_per_m").value, parameters["coefficient_n_s_per_m"].value
        return f": {drag + more:.4g} N s/m forward, {drag - more:.4g} N s/m backward"
    if law == "position_ripple":
        size = float(np.hypot(parameters["sine_n"].value, parameters["cosine_n"].value))
        return f": an amplitude of {size:.2g} N"
    return ""


def blind_spots(table: Table, unidentifiable: Sequence[str], mass_check: MassCheck) -> tuple[str, ...]:
    """Return what these records could not have shown, and the band in which everything was compared."""
    stretch = table.stretches[0]
    out = [
        f"anything faster than {stretch.bandwidth_hz:.3g} Hz: up to there the motion stands clear of its noise, and "
        "force and motion are compared through the same filter",
        "a constant force of the drive and a tilt of the guide are one number here: the offset",
    ]
    mixed = "of any size: in this motion it is a mixture of what is in the model"
    out += [f"{LAWS[law].short_words} {mixed}" for law in unidentifiable]
    if mass_check.stated is None:
        out.append("an error of the force's scale only rescales mass, drag and friction")
    return tuple(out)


def separating(effects: Sequence[FoundEffect], unidentifiable: Sequence[str]) -> str:
    """Return the motion that would show what this one could not."""
    if "coulomb_friction" in unidentifiable:
        return "a motion both ways: one way, friction is a constant force"
    if any(e.indistinguishable_from for e in effects):
        return "another motion: slower reversals, several top speeds, another part of the travel"
    return ""


def rest(table: Table, found: Regression, repeatability: Repeatability) -> str:
    """Say what the remaining force goes with: direction, reversals, place, the cycle."""
    left = found.residual_n
    speed, place = table.velocity_m_per_s, table.displacement_m
    total = float(left @ left)
    slow = np.abs(speed) < 0.1 * float(np.abs(speed).max())
    one_way = np.stack([np.maximum(speed, 0.0), (speed > 0.0).astype(np.float64), speed, np.ones(speed.size)], axis=1)
    waves = [f(2.0 * np.pi * k * place / np.ptp(place)) for k in (1, 2, 3) for f in (np.sin, np.cos)]
    along = np.stack([np.ones(place.size), place, *waves], axis=1)
    times = rms(left) / repeatability.force_n
    parts = [
        f"{rms(left):.3g} N rms remain, {times:.2g} times {repeatability.what} ({repeatability.force_n:.2g} N)",
        f"{_explained(left, one_way):.0%} of their power goes with the direction of motion",
        f"{_explained(left, along):.0%} with the place along the guide",
        f"{float(left[slow] @ left[slow]) / total:.0%} stand in the {np.mean(slow):.0%} of samples around reversals",
    ]
    return "; ".join(parts)


def _explained(left: Floats, columns: Floats) -> float:
    solution, *_ = np.linalg.lstsq(columns, left, rcond=None)
    over = left - columns @ solution
    return 1.0 - float(over @ over) / float(left @ left)
