"""What a diagnosis found, as data: ``wording`` puts it into words, ``result_file`` into the form of docs/formats.md."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect, OwnLaw
from analysis.shot import Fit, Floats, Quantity

if TYPE_CHECKING:
    from analysis.drive import MassCheck, Repeatability


class Verdict(StrEnum):
    """What a diagnosis may conclude."""

    ADEQUATE = "adequate"  # nothing is missing that this data could show
    EFFECT_FOUND = "effect_found"  # the effects account for the remainder down to the noise
    LAW_LEARNED = "law_learned"  # a law off the catalogue, learned from the shots, does (with the effects beside it)
    PARTLY_EXPLAINED = "partly_explained"  # the effects foretell better, a significant remainder stays and is described
    UNEXPLAINED = "unexplained"  # nothing passed every test or foretells better, a significant remainder stays


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean squares of what a model leaves over, on stated samples at a stated bandwidth."""

    displacement_rms_m: float
    velocity_rms_m_per_s: float
    force_rms_n: float
    reduced_chi2: float


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """An effect that passed every gate, or the class it lies in when another cannot be told from it."""

    effect: Effect
    parameters: Mapping[str, Quantity]
    evidence: Mapping[str, float]
    indistinguishable_from: tuple[Effect, ...] = ()

    @property
    def name(self) -> str:
        """Get the effect's name."""
        return self.effect.name


@dataclass(frozen=True, slots=True)
class OtherForm:
    """A closed form that the shots cannot exclude; ``delta_bic`` behind the best.

    ``curve_force_n`` is its curve at the law's ``curve_argument``, shape (n,), where it is of the same argument.
    """

    where: str
    argument: str
    form: str
    formula: str
    delta_bic: float
    curve_force_n: Floats | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the form as the result file has it."""
        names = ("where", "argument", "form", "formula", "delta_bic")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, slots=True)
class LearnedLaw:
    """A law off the catalogue as the shots show it (docs/closed-loop.md).

    ``effect`` is what the model holds.  ``form`` and ``formula`` are None where no closed form meets
    the curve; ``nearest_form`` is what the model holds then.  The curve, arrays of shape (n,), is the free one with its
    standard uncertainty, moved onto the form by what the base model holds already; ``parameters`` are (quantity, unit)
    by name.
    """

    effect: OwnLaw
    where: str
    argument: str
    form: str | None
    formula: str | None
    nearest_form: str
    parameters: Mapping[str, tuple[Quantity, str]]
    other_forms: tuple[OtherForm, ...]
    same_by_gauge: tuple[str, ...]
    curve_argument: Floats
    curve_unit: str
    curve_force_n: Floats
    curve_std_n: Floats
    visited: tuple[float, float]
    not_observable: tuple[str, ...]
    evidence: Mapping[str, float]
    form_force_n: Floats  # of ``nearest_form``, as the model holds it

    @property
    def as_effect(self) -> FoundEffect:
        """Get the law as an effect that can join the model."""
        return FoundEffect(self.effect, {name: q for name, (q, _) in self.parameters.items()}, self.evidence)

    def to_json(self) -> dict[str, Any]:
        """Return the law as the result file has it."""
        return {
            "where": self.where,
            "argument": self.argument,
            "form": self.form,
            "formula": self.formula,
            "nearest_form": self.nearest_form,
            "parameters": {
                name: {"value": q.value, "std": q.std, "unit": unit} for name, (q, unit) in self.parameters.items()
            },
            "other_forms": [other.to_json() for other in self.other_forms],
            "same_by_gauge": list(self.same_by_gauge),
            "curve": {
                "argument": self.curve_argument.tolist(),
                "unit": self.curve_unit,
                "force_n": self.curve_force_n.tolist(),
                "std_n": self.curve_std_n.tolist(),
            },
            "visited": list(self.visited),
            "not_observable": list(self.not_observable),
            "evidence": dict(self.evidence),
        }


class Standing(StrEnum):
    """Why an effect that was tried is in the model or not."""

    IN_MODEL = "in_model"
    SCORED_ONLY = "scored_only"
    DOES_NOT_PAY = "does_not_pay"
    BEHIND_ANOTHER = "behind_another"
    VALIDATED = "validated"  # of a drive: it leaves ``number`` (N) of the force on the validation half
    MIXTURE = "mixture"  # of a drive: in this motion it is a mixture of what is in the model
    RESCALES = "rescales"  # of a drive: while no mass is stated it only rescales mass, drag and friction
    MASS_AGREES = "mass_agrees"  # of a drive: with the stated one
    MASS_DIFFERS = "mass_differs"  # of a drive: it is the same as the mass ``number`` (kg)


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that was tried, with what it would have explained and why it was or was not named.

    ``explains_m`` is the displacement by which the model with it would differ, refitted, in m: one array of shape (k,)
    for each of the first shots, means over k equal parts of the record.  It is to first order where the effect was only
    scored (``delta_bic`` None).  None where there is none; the result file does not have it.
    """

    effect: Effect
    score: float
    delta_bic: float | None
    parameters: Mapping[str, Quantity] = field(default_factory=dict)
    standing: Standing | None = None
    number: Quantity | float | None = None  # that its standing names
    explains_m: tuple[Floats, ...] | None = field(default=None, compare=False, repr=False)

    @property
    def name(self) -> str:
        """Get the effect's name."""
        return self.effect.name


class Phase(StrEnum):
    """A part of a shot."""

    FLIGHT_IN = "flight_in"
    BOUNCES = "bounces"
    LOADING = "loading"
    UNLOADING = "unloading"
    RELEASE = "release"
    FLIGHT_OUT = "flight_out"


class Freedom(StrEnum):
    """A freedom that a right hypothesis has no use for (``lack_of_fit``)."""

    KINKS = "kinks"  # where the bodies meet, turn or part
    KINKS_WITH_SPEED = "kinks_with_speed"  # that grow with the speed
    BASE_APART = "base_apart"  # plate and contact of every shot's own
    EFFECT_APART = "effect_apart"  # the effects of every shot's own
    EFFECT_AFTER_TURN = "effect_after_turn"  # another one than before
    SPEED_AGAINST_MOTION = "speed_against_motion"  # from here on a force of any law of its argument
    SPEED_ONE_WAY = "speed_one_way"
    PLACE = "place"
    BEND = "bend"
    BEND_AGAINST_MOTION = "bend_against_motion"


@dataclass(frozen=True, slots=True)
class Remainder:
    """What a model of a collision leaves of the displacement, above the white noise ``noise_m``; rms in m.

    ``phases`` are the loudest with their rms.  Its size goes as the speed to the power ``speed_power``; a line stands
    at ``line_hz``.  It is nearest to the effects ``imitated_by``, none of which passed every test; what is left beside
    them, or all of it where there are none, has most use for the freedom ``looks_like``, by ``norms`` noise norms.
    """

    rms_m: float
    noise_m: float
    phases: tuple[tuple[Phase, float], ...]
    speed_power: float | None = None
    line_hz: float | None = None
    looks_like: Freedom | None = None
    norms: float = 0.0
    imitated_by: tuple[Effect, ...] = ()


@dataclass(frozen=True, slots=True)
class BlindSpot:
    """An effect that these data would not have shown below ``least`` of its ``parameter``; None: of any size."""

    effect: Effect
    parameter: str
    least: float | None


@dataclass(frozen=True, slots=True)
class DriveRemainder:
    """What a model of a drive leaves of the force: shares of its power that go with the direction and with the place.

    ``reversals`` is the share within the share ``reversal_samples`` of samples around reversals.
    """

    direction: float
    place: float
    reversals: float
    reversal_samples: float


@dataclass(frozen=True, slots=True)
class DriveEvidence:
    """What only the diagnosis of a drive has; ``unidentifiable`` laws are in this motion a mixture of the model's."""

    repeatability: "Repeatability"
    mass: "MassCheck"
    bandwidth_hz: float
    unidentifiable: tuple[Effect, ...]
    remainder: DriveRemainder | None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Verdict with its evidence; ``blind_spots`` is what this data could not show, of the effects that were tried.

    ``effects`` and ``laws`` passed every gate for their size; ``imitated_by`` are effects that come near to what
    remains and did not: their numbers are those of a fit, and no measurement.
    """

    verdict: Verdict
    effects: tuple[FoundEffect, ...]
    candidates: tuple[Candidate, ...]
    error_before: Errors
    error_after: Errors
    error_held_out_before: Errors | None
    error_held_out_after: Errors | None
    fit_before: Fit
    fit_after: Fit
    remainder: Remainder | None = None  # of a collision; None: no more than noise; beside "adequate": a trace
    blind_spots: tuple[BlindSpot, ...] = ()
    speeds_m_per_s: tuple[float, ...] = ()  # of the shots, before the contact
    seconds: float = 0.0
    laws: tuple[LearnedLaw, ...] = ()
    imitated_by: tuple[FoundEffect, ...] = ()
    not_asked: tuple[str, ...] = ()  # what a limit of time left out, in words
    compared: bool = True  # whether there was time to compare the effects of the catalogue
    drive: DriveEvidence | None = None

    @property
    def sentence(self) -> str:
        """Get the verdict in words."""
        from analysis.diagnosis.wording import in_words

        return in_words(self).sentence

    @property
    def findings(self) -> tuple[FoundEffect, ...]:
        """Get what can join the model: the effects, and the laws that have a form."""
        return (*self.effects, *(law.as_effect for law in self.laws if law.form is not None))
