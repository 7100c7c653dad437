"""Stiffness and effective mass of the spring plate: an arm clamped at one end, loaded at the centre of its end disc.

Geometry and E give k_p and the effective mass m_p*; geometry and a measured k_p give E.  Bending is that of slender
beams (S. Timoshenko, "Strength of Materials", part I); the effective mass is Rayleigh's: the kinetic energy of the
whole plate moving in its static shape, over half the square of the load point's velocity.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from uncertainties import umath

from analysis.shot.recording import Plate

# The formulas below take plain floats, or numbers with uncertainty whose correlations are kept.
Number = Any


class Disc(StrEnum):
    RIGID = "rigid"  # the arm alone bends
    BENDING = "bending"  # the disc bends where its chord is wider than the arm; the neck stays rigid
    BENDING_NECK = "bending_neck"  # the neck, from arm_length to where the chord equals the arm's width, bends as arm


@dataclass(frozen=True, slots=True)
class PlateTolerance:
    """Standard uncertainties of a plate's geometry and material.

    Defaults: a calliper to 0.05 mm and a micrometer to 0.005 mm (rectangular); density and modulus from tables for an
    alloy of unknown temper (0.5 % and 2 %).  ``beam_theory`` is the relative error of k_p by beam theory: a
    two-dimensional plate, held flat across its clamp, is 0.9 % stiffer at Poisson's ratio 0.3 (the paper's plate,
    computed with thin-plate elements in the tests).
    """

    arm_length_m: float = 0.05e-3 / math.sqrt(3.0)
    arm_width_m: float = 0.05e-3 / math.sqrt(3.0)
    thickness_m: float = 0.005e-3 / math.sqrt(3.0)
    disc_diameter_m: float = 0.05e-3 / math.sqrt(3.0)
    density_kg_m3: float = 8.51e3 * 0.005
    youngs_modulus_pa: float = 131e9 * 0.02
    beam_theory: float = 0.01


def compliance_times_modulus_per_m(plate: Plate, disc: Disc = Disc.RIGID) -> float:
    """Return E / k_p in 1/m: E times the deflection of the disc's centre under a unit load there.

    Raises ValueError for an impossible plate (no length, an arm wider than its disc).
    """
    _check(plate)
    return float(compliance_of(asdict(plate) | {"beam_theory": 1.0}, disc))


def stiffness_n_per_m(plate: Plate, disc: Disc = Disc.RIGID) -> float:
    """Return k_p in N/m for a load at the disc's centre."""
    return plate.youngs_modulus_pa / compliance_times_modulus_per_m(plate, disc)


def stated_stiffness_n_per_m(plate: Plate | None) -> float | None:
    """Return k_p in N/m of a recording's stated plate; None if no plate, or an impossible one, is stated."""
    try:
        return None if plate is None else stiffness_n_per_m(plate)
    except ValueError:
        return None


def coefficient_c(plate: Plate) -> float:
    """Return c of k_p = c E t^3 w / (4 l^3), rigid disc: l^3 / (L^3 - (L - l)^3), L the distance clamp to load."""
    _check(plate)
    length, load, _ = _arm_and_disc_m(asdict(plate))
    return float(length**3 / (load**3 - (load - length) ** 3))


def mass_kg(plate: Plate) -> float:
    """Return the plate's total mass in kg: arm plus disc, without subtracting their overlap at the neck."""
    return float(_masses(plate)[0])


def effective_mass_kg(plate: Plate) -> float:
    """Return m_p* in kg by Rayleigh's method, with the static shape under a load at the centre of a rigid disc."""
    _check(plate)
    return float(_masses(plate)[1])


def arm_effective_mass_kg(plate: Plate) -> float:
    """Return the arm's part of ``effective_mass_kg``; the remainder is the disc's."""
    _check(plate)
    length, load, _ = _arm_and_disc_m(asdict(plate))
    arm = plate.density_kg_m3 * plate.thickness_m * plate.arm_width_m * plate.arm_length_m
    return float(arm * _arm_ratio(length, load))


def corrected_slope(slope: Number, plate_mass: Number, contact_stiffness: Number, block_mass: Number) -> Number:
    """Return k_p from a measured slope dF/dy, both in N/m; plain floats or numbers with uncertainty.

    F is m_b a and y the block's deflection.  The slope is m_b omega^2 of the slow mode of the two bodies in contact
    (Eq. 4, without damping), to first order k_p / (1 + m_p*/m_b + k_p/k_N).
    """
    return slope / (1 - slope / contact_stiffness) + plate_mass * slope / block_mass


def _check(plate: Plate) -> None:
    for field in fields(plate):
        value = getattr(plate, field.name)
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"plate: {field.name} must be positive, not {value!r}")
    if plate.arm_width_m > plate.disc_diameter_m:
        raise ValueError("plate: the arm is wider than the disc at its end")


def _arm_and_disc_m(n: Mapping[str, Number]) -> tuple[Number, Number, Number]:
    """Return (arm length, distance from clamp to load, disc radius)."""
    radius = n["disc_diameter_m"] / 2
    return n["arm_length_m"], n["arm_length_m"] + radius, radius


def compliance_of(n: Mapping[str, Number], disc: Disc = Disc.RIGID) -> Number:
    """Return E / k_p in 1/m from a plate's fields by name, with "beam_theory" as a correction factor near 1.

    The fields are plain floats or numbers with uncertainty.
    """
    length, load, radius = _arm_and_disc_m(n)
    width, cubed, theory = n["arm_width_m"], n["thickness_m"] ** 3, n["beam_theory"]
    arm = 4 * (load**3 - (load - length) ** 3) / (width * cubed)
    if disc is Disc.RIGID:
        return theory * arm
    # A chord at distance s from the centre is 2 sqrt(R^2 - s^2) wide and carries the moment F s.  The integral of
    # s^2 / (I) is R^2/2 (arcsin u - u sqrt(1 - u^2)), u = s/R, up to where the chord is as wide as the arm.
    half = width / 2
    neck = (radius**2 - half**2) ** 0.5
    chords = radius**2 / 2 * (umath.asin(neck / radius) - neck * half / radius**2)
    bending = 6 / cubed * chords
    if disc is Disc.BENDING_NECK:
        bending = bending + 4 * (radius**3 - neck**3) / (width * cubed)
    return theory * (arm + bending)


def _masses(plate: Plate) -> tuple[float, float]:
    """Return (whole mass, Rayleigh's effective mass)."""
    length, load, radius = _arm_and_disc_m(asdict(plate))
    sheet = plate.density_kg_m3 * plate.thickness_m
    disc = sheet * math.pi * radius**2
    arm = sheet * plate.arm_width_m * length
    tilt = (load**2 - (load - length) ** 2) / 2 / _deflection(length, load)  # the disc's, per deflection of its centre
    return arm + disc, arm * _arm_ratio(length, load) + disc * (1 + (tilt * radius) ** 2 / 4)


def bare_beam_mass_ratio() -> float:
    """Return m*/m = 33/140 of a uniform cantilever loaded at its end, a plate without a disc: the paper's 0.24."""
    return float(_arm_ratio(1.0, 1.0))


def _deflection(length: Number, load: Number) -> Number:
    """Return the load point's deflection under a unit load, times E I."""
    return (load**3 - (load - length) ** 3) / 3


def _arm_ratio(length: Number, load: Number) -> Number:
    """Return the mean of (shape / deflection of the load point)^2 along the arm.

    The static shape x^2 (3 L - x) / 6 squared, x^4 (3 L - x)^2 / 36, integrates to l^5 (9 L^2/5 - L l + l^2/7) / 36.
    """
    squared = length**4 * (9 * load**2 / 5 - load * length + length**2 / 7) / 36
    return squared / _deflection(length, load) ** 2
