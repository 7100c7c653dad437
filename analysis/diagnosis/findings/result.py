"""Results of a diagnosis as data; ``wording`` describes them, ``result_file`` writes them (docs/formats.md)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect, UserLaw
from analysis.shot import Fit, Floats, Quantity

if TYPE_CHECKING:
    from analysis.drive import MassCheck, Repeatability


class Verdict(StrEnum):
    """What a diagnosis may conclude."""

    ADEQUATE = "adequate"  # nothing is missing that these data could show
    EFFECT_FOUND = "effect_found"  # the effects explain the residual down to the noise
    LAW_LEARNED = "law_learned"  # a law learned from the shots explains it, alone or jointly with effects
    PARTLY_EXPLAINED = "partly_explained"  # effects or laws predict better; a significant residual is described
    UNEXPLAINED = "unexplained"  # nothing passed every test or predicts better; a significant residual remains


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean squares of a model's residual, on stated samples at a stated bandwidth."""

    displacement_rms_m: float
    velocity_rms_m_per_s: float
    force_rms_n: float
    reduced_chi2: float


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """An effect of a fit with its parameters and evidence, and the effects that the data do not distinguish from it."""

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
    """A closed form that the shots cannot exclude; its BIC is ``delta_bic`` above that of the best form.

    ``curve_force_n``, shape (n,), is its force at the law's ``curve_argument``; None where its argument is another one.
    """

    where: str
    argument: str
    form: str
    formula: str
    delta_bic: float
    curve_force_n: Floats | None = None


@dataclass(frozen=True, slots=True)
class LearnedLaw:
    """A law outside the catalogue, learned from the shots (docs/closed-loop.md).

    ``effect`` is the law in the model.  ``form`` and ``formula`` are None where no closed form agrees with the curve;
    the model then contains ``nearest_form``.  The curve, arrays of shape (n,), is the free one with its standard
    uncertainty, moved towards the form by terms that the base model can absorb.  ``parameters`` are (quantity, unit)
    by name.
    """

    effect: UserLaw
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
    form_force_n: Floats  # of ``nearest_form``, as in the model

    @property
    def as_effect(self) -> FoundEffect:
        """Get the law as an effect that can be added to the model."""
        return FoundEffect(self.effect, {name: q for name, (q, _) in self.parameters.items()}, self.evidence)

    def to_json(self) -> dict[str, Any]:
        """Return the law as a JSON object of the result file."""
        return {
            "where": self.where,
            "argument": self.argument,
            "form": self.form,
            "formula": self.formula,
            "nearest_form": self.nearest_form,
            "parameters": {
                name: {"value": q.value, "std": q.std, "unit": unit} for name, (q, unit) in self.parameters.items()
            },
            "other_forms": [
                {name: getattr(other, name) for name in ("where", "argument", "form", "formula", "delta_bic")}
                for other in self.other_forms
            ],
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
    """Why a tried effect is or is not in the model."""

    IN_MODEL = "in_model"
    SCORED_ONLY = "scored_only"
    DOES_NOT_PAY = "does_not_pay"
    BEHIND_ANOTHER = "behind_another"
    VALIDATED = "validated"  # of a drive: its force residual on the validation half is ``number`` (N)
    MIXTURE = "mixture"  # of a drive: in this motion it is a combination of the laws in the model
    RESCALES = "rescales"  # of a drive: while no mass is stated it only rescales mass, drag and friction
    MASS_AGREES = "mass_agrees"  # of a drive: the fitted mass agrees with the stated one
    MASS_DIFFERS = "mass_differs"  # of a drive: it is equivalent to a mass of ``number`` (kg)


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that was tried, with the displacement that it explains and why it was or was not named.

    ``explains_m`` is the change of the model's displacement in m when the effect is added and the model refitted: one
    array of shape (k,) for each of the first shots, means over k equal parts of the record.  The change is to first
    order where the effect was only scored (``delta_bic`` None).  It may be None, and is not in the result file.
    """

    effect: Effect
    score: float
    delta_bic: float | None
    parameters: Mapping[str, Quantity] = field(default_factory=dict)
    standing: Standing | None = None
    number: Quantity | float | None = None  # quoted in the words of its standing
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
    """A freedom that a correct hypothesis does not need (``lack_of_fit``)."""

    KINKS = "kinks"  # at touch, turnaround and release
    KINKS_WITH_SPEED = "kinks_with_speed"  # kinks that grow with the speed
    BASE_PER_SHOT = "base_apart"  # separate plate and contact parameters for every shot
    EFFECT_PER_SHOT = "effect_apart"  # separate effect parameters for every shot
    EFFECT_AFTER_TURN = "effect_after_turn"  # the effects differ before and after the turnaround
    SPEED_AGAINST_MOTION = "speed_against_motion"  # this and the following: any force law of the argument
    SPEED_ONE_WAY = "speed_one_way"
    PLACE = "place"
    BEND = "bend"
    BEND_AGAINST_MOTION = "bend_against_motion"


@dataclass(frozen=True, slots=True)
class Remainder:
    """The displacement residual of a collision model above the white noise ``noise_m``; rms in m.

    ``phases`` are the loudest with their rms.  The residual scales as the speed to the power ``speed_power``, and has a
    spectral line at ``line_hz``.  The effects ``imitated_by`` come nearest to it; none passed every test.  Given these
    effects, if any, the freedom ``looks_like`` explains most of the residual: ``norms`` noise norms.
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
    """Detection limit of an effect: ``least`` is the smallest detectable ``parameter``; None: no size is detectable."""

    effect: Effect
    parameter: str
    least: float | None


@dataclass(frozen=True, slots=True)
class DriveRemainder:
    """The force residual of a drive's model: shares of its power that depend on direction and on position.

    ``reversals`` is the share of its power around reversals, ``reversal_samples`` the share of the samples there.
    """

    direction: float
    place: float
    reversals: float
    reversal_samples: float


@dataclass(frozen=True, slots=True)
class DriveEvidence:
    """Evidence of a drive's diagnosis; in this motion, ``unidentifiable`` laws are combinations of the model's laws."""

    repeatability: "Repeatability"
    mass: "MassCheck"
    bandwidth_hz: float
    unidentifiable: tuple[Effect, ...]
    remainder: DriveRemainder | None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Verdict with its evidence; ``blind_spots`` are the detection limits of the effects that were tried.

    ``effects`` and ``laws`` passed every gate for their size.  ``imitated_by`` are effects that come near to the
    residual and did not pass: their numbers come from a fit and are no measurement.
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
    remainder: Remainder | None = None  # of a collision; None: consistent with noise; if "adequate": a trace
    blind_spots: tuple[BlindSpot, ...] = ()
    speeds_m_per_s: tuple[float, ...] = ()  # of the shots, before the contact
    seconds: float = 0.0
    laws: tuple[LearnedLaw, ...] = ()
    imitated_by: tuple[FoundEffect, ...] = ()
    not_asked: tuple[str, ...] = ()  # steps left out for lack of time, in words
    compared: bool = True  # whether there was time to compare the effects of the catalogue
    drive: DriveEvidence | None = None

    @property
    def sentence(self) -> str:
        """Get the verdict in words."""
        from analysis.diagnosis.findings.wording import in_words

        return in_words(self).sentence

    @property
    def findings(self) -> tuple[FoundEffect, ...]:
        """Get what can be added to the model: the effects, and the laws that have a closed form."""
        return (*self.effects, *(law.as_effect for law in self.laws if law.form is not None))


@dataclass(frozen=True, slots=True)
class PredictedShot:
    """One shot: the errors of the base and of the whole model, or why neither could be tested."""

    name: str
    took_part: bool  # in the fit from which the model was saved: then the shot is no test
    error_base: Errors | None
    error_model: Errors | None
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class PredictionTest:
    """The test of a saved model: errors of base and model for all shots together, and each shot."""

    model: str
    effects: tuple[Effect, ...]
    error_base: Errors
    error_model: Errors
    shots: tuple[PredictedShot, ...]
