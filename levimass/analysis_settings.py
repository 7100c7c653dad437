"""The settings of an analysis, each declared once for files, the window's sheet and the command line."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from levimass.setting import choice, number

if TYPE_CHECKING:
    from analysis.collision import Effect
else:
    Effect = object  # the command line reads its options before the analysis is imported

DRIVE = "driven"


@dataclass(frozen=True, slots=True)
class AnalysisChoices:
    """The settings that the operator may choose."""

    bandwidth_hz: float = number(
        *(10e3, "Analysis", "Bandwidth", "kHz", 1e-3, 10.0, 1e6),
        "Of velocity and force; the noise of the force grows with its power 2.5",
    )
    model: str = choice(
        *("paper", "Analysis", "Base model"),
        (
            ("paper", "paper (two bodies)"),
            ("clamped", "damping clamped"),
            ("no_tension", "no tension"),
            ("contact", "one body on a spring"),
            (DRIVE, "driven slider"),
        ),
        "The model that is fitted. Paper: block and plate, damped in both directions, with tension until the "
        "overlap ends; damping clamped: none while they separate, as Eq. 10 is printed; "
        "no tension: the contact never pulls",
    )
    rest: str = choice(
        *("smoothed", "Analysis", "Rest beat"),
        (("smoothed", "smoothed PD0"), ("instantaneous", "instantaneous PD0")),
        "How PD0 is subtracted from PD1",
    )
    fit_seconds: float = number(
        *(20.0, "Analysis", "Longest fit", "s", 1.0, 1e-3, 1e6),
        "Longest time for the fit of one shot; usually it takes less than a second",
        flag="--fit-seconds",
        metavar="S",
    )
    diagnosis_seconds: float = number(
        *(60.0, "Analysis", "Longest diagnosis", "s", 1.0, 1e-3, 1e6),
        "Time after which a diagnosis leaves out further searches and laws, and says so",
        flag="--diagnosis-seconds",
        metavar="S",
    )


@dataclass(frozen=True, slots=True)
class AnalysisSettings(AnalysisChoices):
    """All settings of an analysis; kept with the shot."""

    motion_rate_hz: float = number(100e3, "", "Rate of the motion", "Hz", 1.0, 1.0, 1e9)
    fit: bool = True
    effects: tuple[Effect, ...] = ()  # in the model
    corrections: tuple[tuple[str, float | None], ...] = ()  # of the rig's values after the shot: ``corrected``

    def written(self) -> dict[str, Any]:
        """Return the settings as files have them: effects by their keys."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"effects": [effect.key for effect in self.effects]}


def is_drive(model: str) -> bool:
    """Return whether a base model is that of a slider driven by a measured force, which strikes no plate."""
    return model == DRIVE
