"""Fit a driven slider's mass, drag, offset and requested effects; compare the fitted mass with the stated mass."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect
from analysis.drive.bandwidth import force_noise
from analysis.drive.catalogue import laws_named
from analysis.drive.law_screening import screen_laws
from analysis.drive.regression import Regression, regress, rms
from analysis.drive.repeatability import Repeatability, repeatability_of
from analysis.drive.stretch import Mask, Stretch, Table, low_pass, prepare
from analysis.shot import AnalysisError, Fit, Floats, Motion, Quantity, Stop
from analysis.signal import derivative_filters
from levimass import DRIVE

MASS = "moving_mass_kg"
AGREE_SIGMAS = 4.0
AGREE_SHARE = 0.02  # relative error of the fitted mass allowed for the force's scale or for a missing law
FLAG = "mass_disagrees"


@dataclass(frozen=True, slots=True)
class MassCheck:
    """The stated mass and the mass fitted with it free, and whether they agree."""

    stated: Quantity | None
    fitted: Quantity
    agrees: bool

    @property
    def fixed(self) -> dict[str, float]:
        """Get the parameters held fixed in a fit: the stated mass, if the fitted mass agrees with it."""
        return {MASS: self.stated.value} if self.stated is not None and self.agrees else {}

    @property
    def gain_error(self) -> Quantity | None:
        """Get the fraction by which the force would be wrong if the stated mass were right."""
        if self.stated is None:
            return None
        ratio = self.stated.value / self.fitted.value
        spread = float(np.hypot(self.stated.std / self.stated.value, self.fitted.std / self.fitted.value))
        return Quantity(ratio - 1.0, ratio * spread, "stated over fitted mass")


def check_mass(motions: Sequence[Motion], found: Regression) -> MassCheck:
    """Compare the stated masses with the mass of ``found``, a fit in which the mass is free.

    Raises AnalysisError if the fitted mass is not positive or the records state different masses.
    """
    fitted = found.quantity(MASS)
    if fitted.value <= 0.0:
        if fitted.value < -AGREE_SIGMAS * fitted.std:
            raise AnalysisError(
                f"force and motion give a mass of {fitted} kg: the sign of force_n or of displacement_m is reversed"
            )
        raise AnalysisError(f"force and motion give a mass of {fitted} kg: the motion's acceleration does not weigh it")
    masses = {m.moving_mass_kg: m.moving_mass_u_kg for m in motions if np.isfinite(m.moving_mass_kg)}
    if not masses:
        return MassCheck(None, fitted, True)
    if len(masses) > 1:
        listed = ", ".join(f"{mass:g}" for mass in sorted(masses))
        raise AnalysisError(f"moving_mass_kg: {listed} are stated of one drive; records of one mass go together")
    ((mass, spread),) = masses.items()
    apart = abs(fitted.value - mass)
    allowed = max(AGREE_SIGMAS * float(np.hypot(fitted.std, spread)), AGREE_SHARE * mass)
    return MassCheck(Quantity(mass, spread, "stated"), fitted, apart <= allowed)


def fit_driven(motions: Sequence[Motion], effects: Sequence[Effect | str] = (), stop: Stop = lambda: False) -> Fit:
    """Return the slider's fit; its ``shots`` are empty, because nothing collides.  Raises AnalysisError, Cancelled."""
    began = time.perf_counter()
    table = Table.of(prepare(motions), stop)
    free = fit_accepted(table, [law.name for law in laws_named(effects)])
    mass_check = check_mass(motions, free)
    found = regress(table, free.laws, None, free.nonlinear, mass_check.fixed)
    repeatability = repeatability_of(table, found, filtered_noise_n(motions, table.stretches, found))
    return as_fit(motions, found, mass_check, repeatability, time.perf_counter() - began)


def fit_accepted(table: Table, laws: Sequence[str], mask: Mask | None = None) -> Regression:
    """Return the fit of base and ``laws``, which are added in order of their screening.  Raises AnalysisError."""
    laws_named(laws)  # raises for an unknown law
    found = regress(table, (), mask)
    while missing := [law for law in laws if law not in found.laws]:
        screened = screen_laws(table, found, pairs=len(missing) > 1, laws=missing)
        candidates = [*screened.pairs, *screened.singles]
        if not candidates:
            named = missing[0].replace("_", " ")
            raise AnalysisError(f"{named}: cannot be distinguished from the rest of the model in this motion")
        found = max(candidates, key=lambda g: g.gain_n2).added_to(found, table)
    return found


def as_fit(
    motions: Sequence[Motion],
    found: Regression,
    mass_check: MassCheck,
    repeatability: Repeatability,
    seconds: float,
) -> Fit:
    """Return a regression as a ``Fit``, with chi2 relative to the drive's repeatability."""
    parameters = {name: found.quantity(name) for name in found.names}
    covariance = found.covariance
    if mass_check.fixed and mass_check.stated is not None:
        parameters[MASS] = mass_check.stated
        covariance = covariance.copy()
        covariance[found.names.index(MASS), found.names.index(MASS)] = mass_check.stated.std**2
    return Fit(
        model=DRIVE,
        parameters=parameters,
        covariance=covariance,
        shots=(),
        reduced_chi2=repeatability.chi2(found.rms_n),
        noise_std_m=float(np.median([np.nanmedian(motion.displacement_std_m) for motion in motions])),
        converged=True,
        effects=laws_named(found.laws),
        flags=() if mass_check.agrees else (FLAG,),
        seconds=seconds,
    )


def filtered_noise_n(motions: Sequence[Motion], stretches: Sequence[Stretch], found: Regression) -> float:
    """Return the noise in N of the filtered force minus mass times acceleration."""
    rate, bandwidth = stretches[0].sample_rate_hz, stretches[0].bandwidth_hz
    force = rms(np.array([force_noise(motion) for motion in motions]))
    place = rms(np.array([np.nanmedian(motion.displacement_std_m) for motion in motions]))
    through = float(np.linalg.norm(low_pass(rate, bandwidth)))
    weight = found.quantity(MASS).value * derivative_filters(rate, bandwidth).acceleration_gain
    return float(np.hypot(force * through, weight * place))


def prediction_residual_n(table: Table, effects: Sequence[Effect], parameters: Mapping[str, Quantity]) -> Floats:
    """Return measured minus predicted force of a saved model, shape (m,); only the offset is fitted to the record."""
    known = {name: quantity.value for name, quantity in parameters.items() if name != "offset_n"}
    return regress(table, [effect.name for effect in effects], None, None, known).residual_n
