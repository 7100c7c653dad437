"""Compute the paper's numbers as printed, and again with the causes of the differences taken into account."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from analysis.collision import Collision, Variant
from analysis.paper.paper_simulation import Simulated, half_sine_time_s, simulate
from analysis.shot import HP_5518A_VACUUM_M, STANDARD_AIR, Disc, Plate, refractive_index
from analysis.shot import plate as plates


@dataclass(frozen=True, slots=True)
class PaperRig:
    """The paper's numbers as this program's types, with the thickness as printed."""

    plate_printed: Plate
    plate_mass_kg: float
    wavelength_m: float
    sample_rate_hz: float
    samples: float
    duration_s: float
    collision: Collision
    claims: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class AuditValues:
    """This program's values for one row; errors that are None follow from the values and the paper's number."""

    printed: float | None = None
    simulated: float | None = None
    recomputed: float | None = None
    error_before: float | None = None
    error_after: float | None = None
    settles: bool = True  # False: no computed number can explain the difference
    words: Mapping[str, float] = field(default_factory=dict)


def audit_values(rig: PaperRig) -> dict[str, AuditValues]:
    simulated = simulate(rig.collision)
    return _simulation(rig, simulated) | _widths(rig, simulated) | _plate(rig) | _instrument(rig)


def _simulation(rig: PaperRig, run: Simulated) -> dict[str, AuditValues]:
    paper = rig.claims
    speed = abs(rig.collision.velocity_in_m_per_s)
    clamped = simulate(replace(rig.collision, variant=Variant.CLAMPED))
    no_tension = simulate(replace(rig.collision, variant=Variant.NO_TENSION))
    peaks = run.force_peaks_s
    first, second = peaks[1] - peaks[0], peaks[2] - peaks[1]
    kinetic = paper["cor_force_peaks"]
    laws = {
        "gear": run.velocity_out_gear_m_per_s,
        "clamped": clamped.velocity_out_m_per_s,
        "no_tension": no_tension.velocity_out_m_per_s,
        "clamped_kinetic": clamped.cor_force_peaks,
    }
    return {
        "velocity_out": AuditValues(simulated=run.velocity_out_m_per_s, words=laws),
        "cor_quasi_static": AuditValues(
            simulated=run.cor_quasi_static, words={"paper_ratio": paper["velocity_out"] / speed}
        ),
        "clamp": AuditValues(printed=clamped.velocity_out_m_per_s, simulated=run.velocity_out_m_per_s, words=laws),
        "cor_force_peaks": AuditValues(
            simulated=run.cor_force_peaks,
            words={"t1": first * 1e3, "t2": second * 1e3, "off_us": (kinetic * first - second) * 1e6},
        ),
        "cor_onsets": _with_paper_kinetic(run.cor_onsets, kinetic),
        "cor_flights": _with_paper_kinetic(run.cor_flights, kinetic),
        "cor_contact": AuditValues(simulated=run.cor_contact),
        "force_peak": AuditValues(simulated=run.force_peak_n, words={"at_ms": run.force_peak_at_s * 1e3}),
        "deflection": AuditValues(simulated=run.deflection_max_m),
    }


def _with_paper_kinetic(value: float, kinetic: float) -> AuditValues:
    return AuditValues(simulated=value, words={"against_paper": value / kinetic - 1.0, "paper_kinetic": kinetic})


def _widths(rig: PaperRig, run: Simulated) -> dict[str, AuditValues]:
    paper, c = rig.claims, rig.collision
    half_sine = half_sine_time_s(c.plate_stiffness_n_per_m, c.block_mass_kg + c.plate_mass_kg)
    smooth, outermost = run.fwhm_smooth_s, run.fwhm_outermost_s
    low, high = run.fwhm_smooth_range_s
    slope = run.slope_n_per_m
    corrected = plates.corrected_slope(slope, c.plate_mass_kg, c.contact_stiffness_n_per_m, c.block_mass_kg)
    return {
        "contact_time": AuditValues(
            printed=half_sine,
            simulated=run.contact_time_s,
            words={"half_sine_ms": half_sine * 1e3, "simulated_ms": run.contact_time_s * 1e3},
        ),
        "fwhm_simulated": AuditValues(
            simulated=smooth,
            error_before=paper["fwhm_simulated"] / smooth - 1.0,
            error_after=paper["fwhm_simulated"] / outermost - 1.0,
            words={
                "outermost_ms": outermost * 1e3,
                "smooth_ms": smooth * 1e3,
                "low_ms": low * 1e3,
                "high_ms": high * 1e3,
            },
        ),
        "fwhm_measured": AuditValues(
            printed=paper["contact_time"],
            simulated=smooth,
            recomputed=2.0 / 3.0 * paper["contact_time"],
            error_before=paper["fwhm_measured"] / paper["contact_time"] - 1.0,
            error_after=paper["fwhm_measured"] / smooth - 1.0,
            words={
                "contact_ms": paper["contact_time"] * 1e3,
                "half_sine_ms": 2.0 / 3.0 * paper["contact_time"] * 1e3,
                "smooth_ms": smooth * 1e3,
                "rest": paper["fwhm_measured"] / smooth - 1.0,
            },
        ),
        "slope": AuditValues(
            printed=slope,
            simulated=slope,
            recomputed=corrected,
            words={
                "slope": slope,
                "bias": slope / c.plate_stiffness_n_per_m - 1.0,
                "inertia": 1.0 - c.block_mass_kg / (c.block_mass_kg + c.plate_mass_kg),
                "series": c.plate_stiffness_n_per_m / (c.plate_stiffness_n_per_m + c.contact_stiffness_n_per_m),
                "corrected": corrected,
            },
        ),
    }


def _plate(rig: PaperRig) -> dict[str, AuditValues]:
    printed, stated, k_p = rig.plate_printed, rig.plate_mass_kg, rig.claims["stiffness"]
    thickness = printed.thickness_m * stated / plates.mass_kg(printed)  # that gives a plate of this outline its mass
    plate = replace(printed, thickness_m=round(thickness, 4))  # rounded as the paper prints it, to 0.1 mm
    millimetres = {"thickness_mm": plate.thickness_m * 1e3}
    c_paper, c = rig.claims["coefficient_c"], plates.coefficient_c(plate)
    needed_printed, needed = k_p / _beam(printed), k_p / _beam(plate)
    rigid, bending, neck = (plates.stiffness_n_per_m(plate, disc) for disc in Disc)
    modulus = {disc: k_p * plates.compliance_times_modulus_per_m(plate, disc) for disc in Disc}
    return {
        "thickness": AuditValues(
            recomputed=thickness,
            error_before=plates.mass_kg(printed) / stated - 1.0,
            error_after=plates.mass_kg(plate) / stated - 1.0,
            words=millimetres
            | {
                "printed_mm": printed.thickness_m * 1e3,
                "mass_printed_g": plates.mass_kg(printed) * 1e3,
                "mass_g": plates.mass_kg(plate) * 1e3,
                "stated_g": stated * 1e3,
            },
        ),
        "load_distance": AuditValues(recomputed=plate.arm_length_m + plate.disc_diameter_m / 2.0),
        "coefficient_c": AuditValues(
            printed=needed_printed,
            recomputed=c,
            error_before=c_paper / needed_printed - 1.0,
            error_after=c / needed - 1.0,
            words=millimetres | {"needed_printed": needed_printed, "needed": needed, "geometry": c},
        ),
        "stiffness": AuditValues(
            printed=_beam(printed),
            recomputed=rigid,
            words={"factor": _beam(printed) / k_p, "after": rigid / k_p - 1.0},
        ),
        "stiffness_disc": AuditValues(
            printed=_beam(printed), recomputed=bending, words={"softer": 1.0 - bending / rigid, "neck": neck}
        ),
        "modulus": AuditValues(
            recomputed=modulus[Disc.RIGID],
            words=millimetres
            | {
                "bending_gpa": modulus[Disc.BENDING] * 1e-9,
            },
        ),
    } | _plate_masses(rig, plate)


def _plate_masses(rig: PaperRig, plate: Plate) -> dict[str, AuditValues]:
    stated, effective_paper = rig.plate_mass_kg, rig.claims["effective_mass"]
    tuned, k_p = rig.claims["mass_ratio"], rig.claims["stiffness"]
    mass, effective = plates.mass_kg(plate), plates.effective_mass_kg(plate)
    arm = plates.arm_effective_mass_kg(plate)
    bare = plates.bare_beam_mass_ratio()
    root = math.sqrt(effective_paper / k_p)
    return {
        "mass_ratio": AuditValues(
            printed=bare,
            recomputed=effective / mass,
            words={
                "bare": bare,
                "ratio": effective / mass,
                "disc_share": 1.0 - arm / effective,
                "disc_g": (effective - arm) * 1e3,
                "arm_g": arm * 1e3,
                "mass_g": mass * 1e3,
                "rest": effective / mass / tuned - 1.0,
            },
        ),
        "effective_mass": AuditValues(
            printed=tuned * stated,
            recomputed=tuned * stated,
            words={
                "stated_g": stated * 1e3,
                "product_g": tuned * stated * 1e3,
                "off": tuned * stated / effective_paper - 1.0,
                "factor": effective_paper / stated,
            },
        ),
        "plate_mass": AuditValues(
            recomputed=mass,
            words={"volume_mm3": mass / plate.density_kg_m3 * 1e9, "thickness_mm": plate.thickness_m * 1e3},
        ),
        "period": AuditValues(
            printed=root,
            recomputed=math.pi * root,
            words={"root_ms": root * 1e3, "with_pi_ms": math.pi * root * 1e3},
        ),
    }


def _instrument(rig: PaperRig) -> dict[str, AuditValues]:
    seconds = rig.samples / rig.sample_rate_hz
    index = refractive_index(HP_5518A_VACUUM_M, STANDARD_AIR)
    wavelength = HP_5518A_VACUUM_M / index
    return {
        "record_length": AuditValues(
            printed=seconds,
            recomputed=seconds,
            settles=False,
            words={
                "samples": rig.samples * 1e-6,
                "rate": rig.sample_rate_hz * 1e-6,
                "seconds": seconds,
                "rate_needed": rig.samples / rig.duration_s * 1e-6,
                "samples_needed": rig.sample_rate_hz * rig.duration_s * 1e-6,
            },
        ),
        "wavelength": AuditValues(
            recomputed=wavelength, words={"index": index, "ppm": (wavelength / rig.wavelength_m - 1.0) * 1e6}
        ),
    }


def _beam(plate: Plate) -> float:
    """Return E t^3 w / (4 l^3): an end-loaded cantilever of the arm alone, c = 1."""
    return plate.youngs_modulus_pa * plate.thickness_m**3 * plate.arm_width_m / (4.0 * plate.arm_length_m**3)
