"""How a setting is declared, with bounds, unit and words for files, sheet and command line; those of an analysis."""

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.collision import Effect
else:
    Effect = object  # the command line reads its options before the analysis is imported

Value = float | str | bool | None
MAX_LISTED = 12  # numbers in a list: a plan predicts each with every candidate
_DECLARED = "setting"


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting; the stored value (SI) times ``scale`` is shown in ``unit``.

    Without a ``group`` it is not in the window, without a ``flag`` not on the command line.
    """

    group: str
    words: str
    kind: str  # "number" | "numbers" (SI, separated by blanks) | "choice" | "folder" | "flag"
    unit: str = ""
    scale: float = 1.0
    low: float = float("-inf")
    high: float = float("inf")
    hover: str = ""
    choices: tuple[tuple[str, str], ...] = ()  # (stored, words)
    optional: bool = False  # may be empty
    flag: str = ""  # of the command line
    metavar: str = ""  # its unit or what it names
    key: str = ""  # the name of the dataclass field

    def check(self, value: Value) -> None:
        """Raise ValueError, which names the setting, for a value that is not allowed."""
        if self.kind == "number":
            if value is None and self.optional:
                return
            if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
                raise self.refused(value, f"is outside {self.low:g} to {self.high:g}")
        elif self.kind == "numbers":
            self._check_list(value)
        elif self.kind == "choice":
            if value not in {stored for stored, _ in self.choices}:
                raise self.refused(value, "is not one of the choices")
        elif self.kind == "flag":
            if not isinstance(value, bool):
                raise self.refused(value, "is neither true nor false")
        elif not isinstance(value, str):
            raise self.refused(value, "is not a text")

    def refused(self, value: object, why: str) -> ValueError:
        """Return the error for a value of this setting; a long value is shortened."""
        shown = "a huge number" if isinstance(value, int) and abs(value) > 10**18 else repr(value)
        return ValueError(f"{self.words or self.key}: {shown if len(shown) < 60 else shown[:57] + '...'} {why}")

    def _check_list(self, value: Value) -> None:
        try:
            numbers = [float(word) for word in value.split()] if isinstance(value, str) else None
        except ValueError:
            numbers = None
        if numbers is None:
            raise self.refused(value, "is not a list of numbers")
        if not numbers and not self.optional:
            raise ValueError(f"{self.words}: a number is missing")
        if len(numbers) > MAX_LISTED:
            raise ValueError(f"{self.words}: {len(numbers)} numbers, a plan can compare at most {MAX_LISTED}")
        for number in numbers:
            if not self.low <= number <= self.high:
                raise ValueError(f"{self.words}: {number:g} is outside {self.low:g} to {self.high:g}")


def number(
    default: float | None,
    group: str,
    words: str,
    unit: str = "",
    scale: float = 1.0,
    low: float = float("-inf"),
    high: float = float("inf"),
    hover: str = "",
    **more: Any,
) -> Any:
    """Return a dataclass field for a number from ``low`` to ``high`` (SI); one whose default is None is optional."""
    more.setdefault("optional", default is None)
    return declared(default, Setting(group, words, "number", unit, scale, low, high, hover, **more))


def choice(
    default: str, group: str, words: str, choices: Sequence[tuple[str, str]], hover: str = "", **more: Any
) -> Any:
    """Return a dataclass field for one of ``choices``, each (stored, words)."""
    return declared(default, Setting(group, words, "choice", hover=hover, choices=tuple(choices), **more))


def flag(default: bool, group: str, words: str, hover: str = "") -> Any:
    """Return a dataclass field for yes or no."""
    return declared(default, Setting(group, words, "flag", hover=hover))


def declared(default: Value, setting: Setting) -> Any:
    """Return a dataclass field with a declaration."""
    return field(default=default, metadata={_DECLARED: setting})


def setting_of(of: "Field[Any]") -> Setting | None:
    """Return the declaration of a dataclass field, or None."""
    setting: Setting | None = of.metadata.get(_DECLARED)
    return None if setting is None else replace(setting, key=of.name)


def settings_of(kind: Any) -> tuple[Setting, ...]:
    """Return the declared settings of a dataclass, in the order of its fields."""
    return tuple(found for of in fields(kind) if (found := setting_of(of)) is not None)


PAPER_MODEL, ONE_BODY, DRIVE = "paper", "contact", "driven"


@dataclass(frozen=True, slots=True)
class BaseModel:
    """A base model under its ``name`` in settings and files, with its texts.

    Shots of one that ``collides`` have an impact, and take the effects of the catalogue and own laws.  The others are
    driven by a measured force: their fit has no part for each shot, and they take the laws of a drive.
    """

    name: str
    choice: str  # in the settings
    words: str  # in a sentence
    in_record: str = ""  # its name in a motion record, which can name no others
    bodies: str = ""  # in words, if a record without a force can be of it
    collides: bool = True


BASE_MODELS: Mapping[str, BaseModel] = {
    model.name: model
    for model in (
        BaseModel(PAPER_MODEL, "paper (two bodies)", "paper model", "plate", "block and plate"),
        BaseModel("clamped", "damping clamped", "paper model, no damping while separating"),
        BaseModel("no_tension", "no tension", "paper model without tensile contact force"),
        BaseModel(ONE_BODY, "one body on a spring", "one body on a contact", "contact", "one body, spring"),
        BaseModel(DRIVE, "driven slider", "driven slider", "driven", collides=False),
    )
}


def base_model(name: str) -> BaseModel:
    """Return the base model of this name; one that no fit knows, with the name as its words, if there is none."""
    return BASE_MODELS.get(name) or BaseModel(name, name, name)


@dataclass(frozen=True, slots=True)
class AnalysisChoices:
    """The settings that the operator may choose."""

    bandwidth_hz: float = number(
        *(10e3, "Analysis", "Bandwidth", "kHz", 1e-3, 10.0, 1e6),
        "Of velocity and force; the noise of the force grows with its power 2.5",
    )
    model: str = choice(
        *(PAPER_MODEL, "Analysis", "Base model"),
        [(model.name, model.choice) for model in BASE_MODELS.values()],
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
    corrections: tuple[tuple[str, float | None], ...] = ()  # of the rig's values after the shot

    @property
    def collides(self) -> bool:
        """Get whether shots with this base model collide."""
        return base_model(self.model).collides

    def written(self) -> dict[str, Any]:
        """Return the settings as files have them: effects by their keys."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"effects": [effect.key for effect in self.effects]}
