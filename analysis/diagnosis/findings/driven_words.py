"""Sentences on a drive's diagnosis: verdict, laws, detection limits, residual."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.diagnosis.findings.result import Diagnosis, DriveEvidence, FoundEffect, Verdict
from analysis.diagnosis.findings.words import numbers
from analysis.drive import LAWS, MassCheck, Repeatability
from analysis.shot import Fit, Quantity


def sentence(diagnosis: Diagnosis, drive: DriveEvidence) -> str:
    """Return the verdict as sentences: laws found, force error before and after, repeatability of the drive, mass."""
    before_n, after_n = diagnosis.error_before.force_rms_n, diagnosis.error_after.force_rms_n
    against = f"{after_n:.3g} N is {_repeats(after_n, drive)}"
    if diagnosis.effects:
        listed = "; ".join(effect(one, diagnosis.fit_after) for one in diagnosis.effects)
        held_out = diagnosis.error_held_out_after
        on_half = f", {held_out.force_rms_n:.3g} N on the validation half" if held_out is not None else ""
        text = f"The drive has {listed}. Force error {before_n:.3g} -> {after_n:.3g} N rms{on_half}; {against}."
    elif diagnosis.verdict is Verdict.ADEQUATE:
        text = f"Adequate: mass, viscous drag and offset explain the force; {against}."
    else:
        text = f"Unexplained: {before_n:.3g} N rms remain and no catalogue law predicts them; {against}."
    return f"{text} {_mass(drive.mass)}".strip()


def _repeats(force_n: float, drive: DriveEvidence) -> str:
    repeatability = drive.repeatability
    times = force_n / repeatability.force_n if repeatability.force_n > 0.0 else float("inf")
    return f"{times:.2g} times {_limit(repeatability)} ({repeatability.force_n:.2g} N)"


def _limit(repeatability: Repeatability) -> str:
    if not repeatability.repeats:
        return "the noise of the force in this band"
    if repeatability.cycle_s is None:
        return "the record-to-record repeatability for one input"
    return f"the repeatability of its cycle of {repeatability.cycle_s:.4g} s"


def _mass(mass: MassCheck) -> str:
    """Return a sentence on whether the stated mass is right; "" where none is stated."""
    if mass.stated is None:
        return ""
    if mass.agrees:
        return f"The mass is the stated one, {mass.stated} kg; force and motion give {mass.fitted} kg."
    return (
        f"The stated mass of {mass.stated} kg is contradicted: force and motion give {mass.fitted} kg, which is "
        f"used. The mass is wrong, or the force is, by a factor of {mass.stated.value / mass.fitted.value:.3g}."
    )


def effect(found: FoundEffect, fit: Fit) -> str:
    """Describe one law of a drive's ``fit`` in words and numbers."""
    others = found.indistinguishable_from
    alike = f" (indistinguishable from: {', '.join(other.short_words for other in others)})" if others else ""
    law, meaning = LAWS[found.name], _meaning(found.name, found.parameters, fit.parameters)
    return f"{law.short_words}, {law.formula}: {numbers(found.parameters)}{meaning}{alike}"


def _meaning(law: str, parameters: Mapping[str, Quantity], of_fit: Mapping[str, Quantity]) -> str:
    if law == "stribeck_friction":
        friction = of_fit.get("coulomb_friction.force_n")
        sliding = friction.value if friction is not None else 0.0
        at_rest = sliding + parameters["force_n"].value
        way = "rises" if parameters["force_n"].value > 0.0 else "falls, against Stribeck's sign,"
        speed = 1e3 * parameters["speed_m_per_s"].value
        return f": friction {way} from {sliding:.3g} to {at_rest:.3g} N towards rest, below some {speed:.2g} mm/s"
    if law == "drive_delay":
        late = parameters["time_s"].value
        way = "later" if late > 0.0 else "earlier"
        return f": the motion answers the force {1e3 * abs(late):.2g} ms {way}"
    if law == "directional_viscous_drag":
        drag, more = of_fit["viscous_coefficient_n_s_per_m"].value, parameters["coefficient_n_s_per_m"].value
        return f": {drag + more:.4g} N s/m forward, {drag - more:.4g} N s/m backward"
    if law == "position_ripple":
        size = float(np.hypot(parameters["sine_n"].value, parameters["cosine_n"].value))
        return f": an amplitude of {size:.2g} N"
    return ""


def blind_spots(drive: DriveEvidence) -> tuple[str, ...]:
    """Return the detection limits of these records, among them the bandwidth of the comparison."""
    out = [
        f"anything faster than {drive.bandwidth_hz:.3g} Hz: up to there the motion exceeds its noise, and "
        "force and motion are compared through the same filter",
        "a constant force of the drive and a tilt of the guide are indistinguishable: their sum is the offset",
    ]
    mixed = "of any size: in this motion it is a linear combination of effects in the model"
    out += [f"{law.short_words} {mixed}" for law in drive.unidentifiable]
    if drive.mass.stated is None:
        out.append("an error of the force's scale only rescales mass, drag and friction")
    return tuple(out)


def separating(effects: Sequence[FoundEffect], drive: DriveEvidence) -> str:
    """Return the motion that would distinguish laws that this one does not; "" where there are none."""
    if LAWS["coulomb_friction"] in drive.unidentifiable:
        return "a motion both ways: one way, friction is a constant force"
    if any(e.indistinguishable_from for e in effects):
        return "another motion: slower reversals, several top speeds, another part of the travel"
    return ""


def remainder(left_n: float, drive: DriveEvidence) -> str:
    """Describe the residual force: repeatability, direction, position, reversals; "" where it is explained."""
    left = drive.remainder
    if left is None:
        return ""
    return "; ".join(
        [
            f"{left_n:.3g} N rms remain, {_repeats(left_n, drive)}",
            f"{left.direction:.0%} of their power is correlated with the direction of motion",
            f"{left.place:.0%} with the position along the guide",
            f"{left.reversals:.0%} occurs in the {left.reversal_samples:.0%} of samples around reversals",
        ]
    )
