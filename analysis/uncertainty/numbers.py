"""Declare the numbers of a shot; files, tables, report, window and trends are generated from ``NUMBERS``.

How to add one: docs/add-a-number.md.
"""

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from enum import Enum
from operator import attrgetter

from analysis.fitted import fit_pending
from analysis.shot import NotSeen, Quantity, Reading, Shot, display_unit
from analysis.uncertainty import measurement_equations as by
from analysis.uncertainty.measurement_equations import Equation


class Group(Enum):
    RESTITUTION = "RESTITUTION"
    MOTION = "MOTION"
    PLATE = "PLATE AND CONTACT"
    DRIVE = "DRIVE"  # for a driven slider without collisions; the other groups are for collisions
    ANALYSIS = "ANALYSIS"


class Origin(Enum):
    """The origin of a number, which determines the files that list it."""

    READ = "read from the motion"  # result file, shots.csv, series
    FITTED = "a parameter of the fitted model"  # shots.csv, series; in the result file a parameter of the fit
    DERIVED = "computed by its measurement equation alone"  # budget
    STATED = "information about the shot"  # screen only


@dataclass(frozen=True, slots=True)
class ResultNumber:
    """One result: key in files ("group.name" is nested), name under its group's heading, full words, and SI unit.

    ``computed`` returns the reading from a shot, if it is neither an attribute of the impact nor a fit parameter.
    ``equation`` is the measurement equation; a result without one has no budget.  ``repeats`` is True if the result
    should be the same in other shots of the rig.
    """

    key: str
    name: str
    words: str
    unit: str
    group: Group
    origin: Origin
    meaning: str = ""  # one line
    _: KW_ONLY
    computed: Callable[[Shot], Reading] | None = None
    equation: Equation | None = None
    repeats: bool = False
    in_series: bool = True  # has mean, scatter and trend over impact speed in a series of shots
    symbol: str = ""  # shortest name
    listed: bool = False  # a default column of the list of shots; other numbers are shown only if chosen
    large: bool = False  # shown in LARGE
    headline: bool = False
    folded: str = ""  # explanation, in one sentence, of a number that the window shows only on request

    def find(self, shot: Shot) -> Reading:
        """Return a shot's value in SI units with the uncertainty from noise, or the reason why it has none."""
        if self.computed is not None:
            return self.computed(shot)
        return _of_impact(shot, self.key) if self.origin is Origin.READ else _of_fit(shot, self.key)

    @property
    def scale(self) -> float:
        """Get the factor from the SI unit to the unit shown."""
        return display_unit(self.unit)[0]

    @property
    def shown_unit(self) -> str:
        """Get the unit shown, "" for a ratio."""
        return display_unit(self.unit)[1]

    @property
    def title(self) -> str:
        """Get the name for use without its group's heading: "COR quasi-static"."""
        return f"COR {self.name}" if self.group is Group.RESTITUTION else self.name

    @property
    def head(self) -> str:
        """Get the heading of the column in the list of shots, with the unit."""
        short = self.symbol if self.listed and self.group is not Group.RESTITUTION else ""
        return with_unit(short or self.title, self.shown_unit)


def _of_impact(shot: Shot, key: str) -> Reading:
    if shot.impact is None:
        return NotSeen(shot.problem or "no impact")
    reading: Reading = attrgetter(key)(shot.impact)
    return reading


def _of_fit(shot: Shot, key: str) -> Reading:
    if shot.fit is None:
        return NotSeen("the fit is still to come" if fit_pending(shot) else "no fit")
    if not shot.fit.converged:
        return NotSeen("the fit did not converge, so its numbers are guesses")
    return shot.fit.parameters.get(key, NotSeen(f"not in the model {shot.fit.model}"))


def _chi2(shot: Shot) -> Reading:
    if shot.fit is None or not shot.fit.converged:
        return NotSeen("no converged fit")
    return Quantity(shot.fit.reduced_chi2, 0.0, "the fit of this shot alone")


def _mass(shot: Shot) -> Reading:
    if shot.motion is None:
        return NotSeen(shot.problem or "no motion")
    if not math.isfinite(shot.motion.moving_mass_kg):
        return NotSeen("no mass is stated")
    return Quantity(shot.motion.moving_mass_kg, shot.motion.moving_mass_u_kg, "as stated for the shot")


RESTITUTION, MOTION, PLATE, DRIVE = Group.RESTITUTION, Group.MOTION, Group.PLATE, Group.DRIVE
READ, FITTED, DERIVED, STATED = Origin.READ, Origin.FITTED, Origin.DERIVED, Origin.STATED

# fmt: off
NUMBERS = (
    ResultNumber(
        "velocity_in_m_per_s", "velocity in", "velocity before touch", "m/s", MOTION, READ,
        "Free flight just before first touch.",
        equation=by.velocity("beat noise, flight in"), in_series=False, symbol="v in", listed=True, large=True,
    ),
    ResultNumber(
        "velocity_out_m_per_s", "velocity out", "velocity after release", "m/s", MOTION, READ,
        "Free flight just after release.",
        equation=by.velocity("beat noise, flight out"), in_series=False, symbol="v out", listed=True, large=True,
    ),
    ResultNumber(
        "cor_quasi_static", "quasi-static", "quasi-static COR", "1", RESTITUTION, READ,
        "Speed out over speed in, |v_f / v_i|.",
        equation=by.ratio_of_velocities, repeats=True, symbol="COR", listed=True, large=True, headline=True,
    ),
    ResultNumber(
        "cor_impulse", "impulse ratio", "impulse ratio", "1", RESTITUTION, READ,
        "Impulse while unloading over impulse while loading.", equation=by.ratio_of_impulses, repeats=True,
    ),
    ResultNumber(
        "cor_kinetic.force_peaks", "kinetic, peaks", "kinetic COR, force peaks", "1", RESTITUTION, READ,
        "T2/T1 of the first bounces between force peaks: the paper's kinetic COR.",
        equation=by.ratio_of_times(by.between_peaks), repeats=True, listed=True,
    ),
    ResultNumber(
        "cor_kinetic.onsets", "kinetic, onsets", "kinetic COR, onsets", "1", RESTITUTION, READ,
        "T2/T1 between the onsets of contact.", equation=by.ratio_of_times(by.between_onsets), repeats=True,
        folded="T2/T1 timed between the onsets of contact, where the force leaves zero.",
    ),
    ResultNumber(
        "cor_kinetic.flights", "kinetic, flights", "kinetic COR, flights", "1", RESTITUTION, READ,
        "Ratio of the first two flight times.", equation=by.ratio_of_times(by.first_flights), repeats=True,
        folded="Second over first flight time, from release to touch: short flights, so a wide ±.",
    ),
    ResultNumber(
        "cor_kinetic.contact", "fitted contact", "kinetic COR, fitted contact", "1", RESTITUTION, READ,
        "Relative velocity out over in at the first contact.", equation=by.scaled(by.FIT_NOISE), repeats=True,
        folded="Relative velocity out over in at the first contact, as the fitted model has it.",
    ),
    ResultNumber(
        "force_peak_n", "peak force", "peak force", "N", MOTION, READ, "Largest force of the plate on the block.",
        equation=by.peak_force, symbol="F max", listed=True, large=True,
    ),
    ResultNumber(
        "force_fwhm_s", "pulse width", "pulse width (FWHM)", "s", MOTION, READ,
        "Full width at half maximum of the smooth pulse.",
        equation=by.scaled("beat noise, pulse width", by.clock),
    ),
    ResultNumber(
        "contact_time_s", "contact time", "contact time", "s", MOTION, READ, "From first touch to last release.",
        equation=by.scaled("beat noise, contact time", by.clock), symbol="contact", large=True,
    ),
    ResultNumber(
        "deflection_max_m", "deflection", "deflection", "m", MOTION, READ, "Greatest deflection of the plate.",
        equation=by.deflection,
    ),
    ResultNumber(
        "plate_stiffness_n_per_m", "k_p", "k_p, fitted", "N/m", PLATE, FITTED, "Stiffness of the plate, fitted.",
        equation=by.scaled(by.FIT_NOISE, by.stiffness, length_cancels=True), repeats=True, listed=True,
    ),
    ResultNumber(
        "plate_mass_kg", "m_p*", "m_p*, fitted", "kg", PLATE, FITTED, "Effective moving mass of the plate, fitted.",
        equation=by.scaled(by.FIT_NOISE, by.mass), repeats=True,
    ),
    ResultNumber(
        "contact_stiffness_n_per_m", "k_N", "k_N, fitted", "N/m", PLATE, FITTED, "Stiffness of the contact, fitted.",
        equation=by.scaled(by.FIT_NOISE, by.stiffness), repeats=True,
    ),
    ResultNumber(
        "contact_damping_n_s_per_m", "γ_N", "γ_N, fitted", "N s/m", PLATE, FITTED, "Damping of the contact, fitted.",
        equation=by.scaled(by.FIT_NOISE, by.damping), repeats=True,
    ),
    ResultNumber(
        "stiffness_slope_n_per_m", "slope of F", "slope of force vs deflection", "N/m", PLATE, READ,
        "Slope of force against deflection; lies about 3 % below k_p.",
        equation=by.slope_of_force, repeats=True,
    ),
    ResultNumber(
        "stiffness_from_slope_n_per_m", "k_p from slope", "k_p, slope corrected", "N/m", PLATE, DERIVED,
        equation=by.stiffness_from_slope,
    ),
    ResultNumber("youngs_modulus_pa", "E", "E of the plate", "Pa", PLATE, DERIVED, equation=by.youngs_modulus),
    ResultNumber("moving_mass_kg", "mass", "mass", "kg", DRIVE, STATED, "The fitted mass that moves.", large=True),
    ResultNumber(
        "viscous_coefficient_n_s_per_m", "viscous drag", "viscous drag", "N s/m", DRIVE, STATED,
        "Force per unit of speed.", large=True,
    ),
    ResultNumber(
        "offset_n", "offset", "offset", "N", DRIVE, STATED, "A constant force: the drive's, or a tilt's.", large=True,
    ),
    ResultNumber(
        "reduced_chi2", "χ²/ν", "reduced χ²", "1", Group.ANALYSIS, STATED, "Of this shot's own fit.", computed=_chi2,
    ),
    ResultNumber(
        "stated_mass_kg", "moving mass", "moving mass", "kg", Group.ANALYSIS, STATED, "As stated for the shot.",
        computed=_mass,
    ),
)
# fmt: on


def with_unit(words: str, unit: str) -> str:
    """Return words with their unit, "deflection (mm)"; the words alone if there is no unit."""
    return f"{words} ({unit})" if unit else words


def collision_numbers(*origins: Origin) -> list[ResultNumber]:
    """Return the numbers of a collision that have these origins, in the order of the result file."""
    return [number for number in NUMBERS if number.origin in origins and number.group is not Group.DRIVE]


def series_numbers() -> list[ResultNumber]:
    return [number for number in collision_numbers(Origin.READ, Origin.FITTED) if number.in_series]


def shown_numbers(group: Group) -> list[ResultNumber]:
    return [number for number in NUMBERS if number.group is group and number.origin is not Origin.DERIVED]


def number_with_key(key: str) -> ResultNumber:
    """Return the number with this key; raises KeyError for an unknown key."""
    for number in NUMBERS:
        if number.key == key:
            return number
    raise KeyError(key)


def read_number(shot: Shot, key: str) -> Reading:
    """Return a shot's number by key, in SI units with the uncertainty from noise; KeyError for an unknown key."""
    return number_with_key(key).find(shot)
