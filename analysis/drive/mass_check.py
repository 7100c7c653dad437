"""Compare the stated mass of a driven slider with the mass that force and motion give."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.drive.regression import Regression
from analysis.shot import AnalysisError, Motion, Quantity

MASS = "moving_mass_kg"
AGREE_SIGMAS = 4.0
AGREE_SHARE = 0.02  # by so much a force's scale, or a law still missing, may change the fitted mass
FLAG = "mass_disagrees"


@dataclass(frozen=True, slots=True)
class MassCheck:
    """The stated mass and the mass fitted with it free, and whether they agree."""

    stated: Quantity | None
    fitted: Quantity
    agrees: bool

    @property
    def fixed(self) -> dict[str, float]:
        """Get the parameters that a fit takes as known: the stated mass where the fitted one agrees with it."""
        return {MASS: self.stated.value} if self.stated is not None and self.agrees else {}

    @property
    def gain_error(self) -> Quantity | None:
        """Get the fraction by which the force would be wrong if the stated mass were right."""
        if self.stated is None:
            return None
        ratio = self.stated.value / self.fitted.value
        spread = float(np.hypot(self.stated.std / self.stated.value, self.fitted.std / self.fitted.value))
        return Quantity(ratio - 1.0, abs(ratio) * spread, "stated over fitted mass")


def check_mass(motions: Sequence[Motion], found: Regression) -> MassCheck:
    """Compare the stated masses with that of ``found``, a fit with the mass free.

    Raises AnalysisError where the fitted mass is not positive or the records state different masses.
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
