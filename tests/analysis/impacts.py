"""An impact with chosen readings, for tests that need no motion."""

from typing import Any

from analysis.shot.impact import Impact, KineticCor
from analysis.shot.quantity import Quantity


def impact_of(**changes: Any) -> Impact:
    """Return the readings of the reference solution (docs/physics.md, "the model") with small uncertainties."""
    readings: dict[str, Any] = {
        "touch_time_s": Quantity(0.02, 1e-7),
        "release_time_s": Quantity(0.02 + 28.70771255e-3, 1e-6),
        "turnaround_time_s": Quantity(0.0343, 3e-6),
        "velocity_in_m_per_s": Quantity(-0.265, 1e-8),
        "velocity_out_m_per_s": Quantity(0.261702343, 1e-8),
        "cor_quasi_static": Quantity(0.987556, 5e-8),
        "cor_impulse": Quantity(0.98755, 2e-6),
        "cor_kinetic": KineticCor(Quantity(0.5632, 1e-3), Quantity(0.5003, 1e-3), Quantity(0.168, 2e-3)),
        "force_peak_n": Quantity(0.511915, 1e-4),
        "force_fwhm_s": Quantity(19.05e-3, 5e-5),
        "contact_time_s": Quantity(28.70771255e-3, 1e-6),
        "deflection_max_m": Quantity(2.388512e-3, 1e-8),
        "stiffness_slope_n_per_m": Quantity(214.33, 0.05),
    }
    return Impact(**(readings | changes))
