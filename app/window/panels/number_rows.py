"""Which numbers of a shot the panel shows: name, where each is found, unit, and what it means in a line."""

from collections.abc import Callable
from dataclasses import dataclass

from analysis.fitted.awaited_fit import awaits_fit
from analysis.shot.quantity import NotSeen, Quantity, Reading
from analysis.shot.shot import Shot

Find = Callable[[Shot], Reading | None]


def _impact(name: str) -> Find:
    def find(shot: Shot) -> Reading | None:
        return getattr(shot.impact, name) if shot.impact is not None else None

    return find


def _kinetic(name: str) -> Find:
    def find(shot: Shot) -> Reading | None:
        return getattr(shot.impact.cor_kinetic, name) if shot.impact is not None else None

    return find


def _parameter(name: str) -> Find:
    def find(shot: Shot) -> Reading | None:
        if shot.fit is None:
            return NotSeen("the fit is still to come") if awaits_fit(shot) else None
        if not shot.fit.converged:
            return NotSeen("the fit did not converge, so its numbers are guesses")
        return shot.fit.parameters.get(name, NotSeen(f"the model {shot.fit.model} has no such parameter"))

    return find


def chi2_of(shot: Shot) -> Reading | None:
    """Return the reduced chi2 of a shot's own fit."""
    if shot.fit is None or not shot.fit.converged:
        return NotSeen("no converged fit")
    return Quantity(shot.fit.reduced_chi2, 0.0, "the fit of this shot alone")


def mass_of(shot: Shot) -> Reading | None:
    """Return the moving mass that a shot was analysed with."""
    if shot.motion is None:
        return NotSeen(shot.problem or "no motion")
    return Quantity(shot.motion.moving_mass_kg, shot.motion.moving_mass_u_kg, "as stated for the shot")


@dataclass(frozen=True, slots=True)
class Row:
    """One number: its name, how to find it, scale and unit of the screen, and what it means in a line."""

    name: str
    find: Find
    scale: float = 1.0
    unit: str = ""
    meaning: str = ""
    headline: bool = False
    key: str = ""  # its name in budget and flags
    folded: str = ""  # of a number that is shown on request: a sentence that says what it is


GROUPS: tuple[tuple[str, tuple[Row, ...]], ...] = (
    (
        "RESTITUTION",
        (
            Row(
                "quasi-static",
                _impact("cor_quasi_static"),
                meaning="Speed out over speed in, |v_f / v_i|.",
                headline=True,
                key="cor_quasi_static",
            ),
            Row(
                "impulse ratio",
                _impact("cor_impulse"),
                meaning="Impulse while unloading over impulse while loading.",
                key="cor_impulse",
            ),
            Row(
                "kinetic, peaks",
                _kinetic("force_peaks"),
                meaning="T2/T1 of the first bounces between force peaks: the paper's kinetic COR.",
                key="cor_kinetic.force_peaks",
            ),
            Row(
                "kinetic, onsets",
                _kinetic("onsets"),
                meaning="T2/T1 between the onsets of contact.",
                key="cor_kinetic.onsets",
                folded="T2/T1 timed between the onsets of contact, where the force leaves zero.",
            ),
            Row(
                "kinetic, flights",
                _kinetic("flights"),
                meaning="Ratio of the first two flight times.",
                key="cor_kinetic.flights",
                folded="Second over first flight time, from release to touch: short flights, so a wide ±.",
            ),
            Row(
                "fitted contact",
                _kinetic("contact"),
                meaning="Relative velocity out over in at the first contact.",
                key="cor_kinetic.contact",
                folded="Relative velocity out over in at the first contact, as the fitted model has it.",
            ),
        ),
    ),
    (
        "MOTION",
        (
            Row(
                "velocity in",
                _impact("velocity_in_m_per_s"),
                1.0,
                "m/s",
                "Free flight just before first touch.",
                key="velocity_in_m_per_s",
            ),
            Row(
                "velocity out",
                _impact("velocity_out_m_per_s"),
                1.0,
                "m/s",
                "Free flight just after release.",
                key="velocity_out_m_per_s",
            ),
            Row(
                "peak force",
                _impact("force_peak_n"),
                1.0,
                "N",
                "Largest force of the plate on the block.",
                key="force_peak_n",
            ),
            Row(
                "pulse width",
                _impact("force_fwhm_s"),
                1e3,
                "ms",
                "Full width at half maximum of the smooth pulse.",
                key="force_fwhm_s",
            ),
            Row(
                "contact time",
                _impact("contact_time_s"),
                1e3,
                "ms",
                "From first touch to last release.",
                key="contact_time_s",
            ),
            Row(
                "deflection",
                _impact("deflection_max_m"),
                1e3,
                "mm",
                "Greatest deflection of the plate.",
                key="deflection_max_m",
            ),
        ),
    ),
    (
        "PLATE AND CONTACT",
        (
            Row(
                "slope of F",
                _impact("stiffness_slope_n_per_m"),
                1.0,
                "N/m",
                "Slope of force against deflection; lies about 3 % below k_p.",
                key="stiffness_slope_n_per_m",
            ),
            Row(
                "k_p",
                _parameter("plate_stiffness_n_per_m"),
                1.0,
                "N/m",
                "Stiffness of the plate, fitted.",
                key="plate_stiffness_n_per_m",
            ),
            Row(
                "m_p*",
                _parameter("plate_mass_kg"),
                1e3,
                "g",
                "Effective moving mass of the plate, fitted.",
                key="plate_mass_kg",
            ),
            Row(
                "k_N",
                _parameter("contact_stiffness_n_per_m"),
                1.0,
                "N/m",
                "Stiffness of the contact, fitted.",
                key="contact_stiffness_n_per_m",
            ),
            Row(
                "γ_N",
                _parameter("contact_damping_n_s_per_m"),
                1.0,
                "N s/m",
                "Damping of the contact, fitted.",
                key="contact_damping_n_s_per_m",
            ),
        ),
    ),
)

DRIVE = "DRIVE"  # the group of a driven slider, which strikes nothing; the others are a collision's
GROUPS = (
    *GROUPS,
    (
        DRIVE,
        (
            Row("mass", _parameter("moving_mass_kg"), 1.0, "kg", "The mass that the force accelerates, fitted."),
            Row("viscous drag", _parameter("viscous_coefficient_n_s_per_m"), 1.0, "N s/m", "Force per unit of speed."),
            Row("offset", _parameter("offset_n"), 1.0, "N", "A constant force: of the drive, or a tilt of the guide."),
        ),
    ),
)
