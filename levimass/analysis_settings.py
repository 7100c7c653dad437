"""How a shot is analysed: each choice declared once, for files, the window's sheet and the command line."""

from dataclasses import dataclass

from levimass.setting import choice, number


@dataclass(frozen=True, slots=True)
class AnalysisChoices:
    """What a person may choose about an analysis."""

    bandwidth_hz: float = number(
        *(10e3, "Analysis", "Bandwidth", "kHz", 1e-3, 10.0, 1e6),
        "Of velocity and force; noise of force grows with its power 2.5",
    )
    model: str = choice(
        *("paper", "Analysis", "Base model"),
        (
            ("paper", "paper (two bodies)"),
            ("clamped", "damping clamped"),
            ("no_tension", "no tension"),
            ("contact", "one body on a spring"),
            ("driven", "driven slider"),
        ),
        "What is simulated and fitted. Paper: block and plate, damped both ways, pulling until the overlap is "
        "gone; damping clamped: none while they part, as Eq. 10 is printed; no tension: the contact never pulls",
    )
    rest: str = choice(
        *("smoothed", "Analysis", "Rest beat"),
        (("smoothed", "smoothed PD0"), ("instantaneous", "instantaneous PD0")),
        "How PD0 is subtracted from PD1",
    )
    fit_seconds: float = number(
        *(20.0, "Analysis", "Longest fit", "s", 1.0, 1e-3, 1e6),
        "Longest that the fit of one shot may take; a usual fit takes one second",
        flag="--fit-seconds",
        metavar="S",
    )
    diagnosis_seconds: float = number(
        *(60.0, "Analysis", "Longest diagnosis", "s", 1.0, 1e-3, 1e6),
        "Time after which a diagnosis leaves out other ways and laws, and says so",
        flag="--diagnosis-seconds",
        metavar="S",
    )


@dataclass(frozen=True, slots=True)
class AnalysisSettings(AnalysisChoices):
    """How a shot is analysed; kept with the shot it was used for."""

    motion_rate_hz: float = number(100e3, "", "Rate of the motion", "Hz", 1.0, 1.0, 1e9)
    fit: bool = True
    effects: tuple[str, ...] = ()  # of the catalogue, accepted into the model
    corrections: tuple[tuple[str, float | None], ...] = ()  # values of the rig put right afterwards: ``corrected``
