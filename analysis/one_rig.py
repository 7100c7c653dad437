"""Whether shots may be judged together: of one base model and one plate; their masses may differ."""

from collections.abc import Sequence

from analysis.plate import stiffness_n_per_m
from analysis.recording import Setup
from analysis.shot import Shot
from analysis.weights import numbered

_MEASURED_AGAIN = 0.1  # of the stiffness: the thickness to 3 %; further off it is another plate


def why_not_together(shots: Sequence[Shot]) -> str | None:
    """Return why these shots cannot be fitted or diagnosed together, in words; None where they can.

    A plate counts where the recording states it; one that is measured again is the same plate.
    """
    models = sorted({shot.settings.model for shot in shots})
    if len(models) > 1:
        return f"the shots use different base models ({', '.join(models)}): select shots of one"
    stiffness = [_stated_n_per_m(shot.setup) for shot in shots]
    first = next((value for value in stiffness if value is not None), None)
    if first is None:
        return None
    other = [value is not None and abs(value / first - 1) > _MEASURED_AGAIN for value in stiffness]
    if not any(other):
        return None
    return f"the shots are of different plates ({numbered(['another' if o else 'one' for o in other])}): select one's"


def _stated_n_per_m(setup: Setup | None) -> float | None:
    """Return the stiffness of the plate that a recording states; None where it states none that can be."""
    if setup is None or setup.plate is None:
        return None
    try:
        return stiffness_n_per_m(setup.plate)
    except ValueError:
        return None
