"""Recognise contact laws of the literature by their exponents p and q: force k d^p + c d^q d' of the overlap d.

A contact law is named where the fitted exponents agree with its own within their uncertainty.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.diagnosis.findings.result import FoundEffect, LearnedLaw
from analysis.shot import Quantity

_ROW = "nonlinear_contact_damping"  # of the catalogue
_WITHIN = 3.0  # standard deviations
_KNOWN = 0.05  # an exponent with a larger standard deviation would agree with every contact law


@dataclass(frozen=True, slots=True)
class Member:
    """A contact law of the literature: exponents of force and damping (None: no damping was found), and its name."""

    force: float
    damping: float | None
    words: str


# Hertz, J. reine angew. Math. 92 (1881) 156; Kuwabara and Kono, Jpn. J. Appl. Phys. 26 (1987) 1230; Tsuji, Tanaka and
# Ishida, Powder Technol. 71 (1992) 239; Hunt and Crossley, J. Appl. Mech. 42 (1975) 440.
MEMBERS = (
    Member(1.5, 0.5, "Kuwabara's and Kono's contact of viscoelastic spheres (3/2 and 1/2)"),
    Member(1.5, 0.25, "Tsuji's contact, whose restitution does not depend on the speed (3/2 and 1/4)"),
    Member(1.5, 1.5, "Hunt's and Crossley's contact on Hertz's (3/2 and 3/2)"),
    Member(1.0, 1.0, "Hunt's and Crossley's contact on a linear spring (1 and 1)"),
    Member(1.5, None, "Hertz's contact (3/2)"),
)


def sentence(effects: Sequence[FoundEffect], laws: Sequence[LearnedLaw]) -> str:
    """Return a sentence that names the contact law that was found, or an empty string.

    The catalogue's damping assumes its exponent, and the sentence says so: small damping fits other exponents too.
    """
    force, damping = _force(effects, laws), _damping(effects, laws)
    if force is None and damping is None:
        return ""
    for one in MEMBERS:
        meets_damping = damping is None if one.damping is None else _meets(damping, one.damping)
        if meets_damping and _meets(force or Quantity(1.0, 0.0, "the base model's"), one.force):
            if any(effect.name == _ROW for effect in effects):
                return f" Its form is that of {one.words}; other exponents of the damping were not tried."
            return f" Its exponents are those of {one.words}."
    return ""


def _meets(found: Quantity | None, exponent: float) -> bool:
    return found is not None and found.std < _KNOWN and abs(found.value - exponent) <= max(_WITHIN * found.std, 1e-9)


def _force(effects: Sequence[FoundEffect], laws: Sequence[LearnedLaw]) -> Quantity | None:
    for effect in effects:
        if effect.name == "contact_exponent":
            delta = effect.parameters["delta"]
            return Quantity(1.0 + delta.value, delta.std, delta.how)
    return _power(laws, "overlap")


def _damping(effects: Sequence[FoundEffect], laws: Sequence[LearnedLaw]) -> Quantity | None:
    if any(effect.name == _ROW for effect in effects):
        return Quantity(1.0, 0.0, "the row of the catalogue")
    return _power(laws, "overlap times rate")


def _power(laws: Sequence[LearnedLaw], argument: str) -> Quantity | None:
    for law in laws:
        if law.where == "contact" and law.argument == argument:
            if law.form == "linear":
                return Quantity(1.0, 0.0, "the form")
            if law.form in ("power", "power, odd"):
                return law.parameters["n"][0]
    return None
