"""Which effects and laws an explanation names and what it says remains, over fits and gates that are given."""

from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis import explanation as module
from analysis.diagnosis.explanation import Explanation
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import FoundEffect, Verdict

DRAG, TILT, ARM = effects_named(("viscous_drag", "tilt", "viscoelastic_arm"))


class Fit:
    """A fit of some effects, whose profile and criterion are known."""

    def __init__(self, *effects: Any, bic: float = 100.0) -> None:
        self.effects, self.bic, self.noise, self.converged = effects, bic, f"noise of {len(effects)}", True

    def __repr__(self) -> str:
        return f"Fit{self.effects}"

    def with_marginal_covariance(self) -> Any:
        return "likely", self


class Stage:
    """Stands in for what an explanation asks; ``left`` says whether a fit of so many effects leaves something."""

    def __init__(
        self,
        patch: pytest.MonkeyPatch,
        best: Fit,
        *,
        doubtful: tuple[Any, ...] = (),
        left: Any = (),
        named: bool = True,
    ) -> None:
        self.start, self.best, self.doubtful, self.left, self.named = Fit(), best, doubtful, left, named
        self.told: list[Any] = []
        self.trail: Any = SimpleNamespace(
            start=self.start, nothing_pays="pays", linearised=lambda fit: ("linear", fit.effects),
            added=lambda fit: list(fit.effects),
        )  # fmt: skip
        self.question: Any = SimpleNamespace(
            progress=lambda *what: self.told.append(what), stop="stop", limit="limit"
        )  # fmt: skip
        self.nothing_without: tuple[Any, ...] = ()
        patch.setattr(module, "at_other_scales", lambda fit, trail: (fit, trail))
        patch.setattr(module, "with_std_over", lambda fit, others: fit if others == (fit[1], self.trail) else None)
        patch.setattr(module, "with_profile_std", lambda fit, stop: (stop, *fit))
        patch.setattr(module, "effect_parameters", lambda sure: {one: f"of {one.name}" for one in sure[2].effects})
        patch.setattr(module, "_found", self.found)
        patch.setattr(module, "accepted_effects", self.accepted)
        patch.setattr(
            module,
            "exceeds_residual",
            lambda one, residual, times: times == CRITERIA.clear_of_misfit and one.effect not in self.doubtful,
        )
        patch.setattr(module, "without", self.without)
        patch.setattr(module, "residual_of", lambda fit, at: self.residual(len(fit.effects)))
        patch.setattr(module, "separations_of", lambda fit, at, trail: {one: f"far {one.name}" for one in fit.effects})
        patch.setattr(module, "remainder_of", lambda *given: ("remainder", *given))
        patch.setattr(module, "predict", lambda fit, held, noise, stop: (fit.effects, held, noise, stop))

    def residual(self, count: int) -> Any:
        return SimpleNamespace(significant=count in self.left, misfit=f"misfit {count}", count=count)

    def found(self, best: Any, effect: Any, parameters: Any, residual: Any, separation: Any, trail: Any) -> Any:
        assert (parameters, separation) == (f"of {effect.name}", f"far {effect.name}") and best.effects
        return FoundEffect(effect, {}, {"count": float(residual.count)}, ())

    def accepted(self, found: Any, residual: Any, best: Any, *, nothing_pays: Any = False) -> Any:
        assert nothing_pays in ("pays", False) and [one.effect for one in found] == list(best.effects)
        passes = self.named and not (set(best.effects) & set(self.doubtful))
        effects = found if passes else []
        if residual.significant:
            return effects, Verdict.PARTLY_EXPLAINED if effects else Verdict.UNEXPLAINED
        return effects, Verdict.EFFECT_FOUND if effects else (Verdict.UNEXPLAINED if found else Verdict.ADEQUATE)

    def without(self, best: Fit, effect: Any, trail: Any) -> Any:
        return None if effect in self.nothing_without else Fit(*(one for one in best.effects if one is not effect))

    def explained(self, predictions: Any = ("before", "told"), predicted: Any = None) -> Explanation:
        settled: Any = SimpleNamespace(
            best=self.best, linearised="at", residual=self.residual(len(self.best.effects)), predictions=predictions,
            separations={one: f"far {one.name}" for one in self.best.effects}, predicted=predicted or self.best,
        )  # fmt: skip
        return module.explain_with_effects(self.question, self.trail, settled, (4,))


def test_effects_that_pass_every_gate_are_named_with_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch, Fit(DRAG, TILT))
    made: Any = stage.explained()
    assert made.verdict is Verdict.EFFECT_FOUND and made.explained
    assert [one.effect for one in made.effects] == [DRAG, TILT] and made.imitations == ()
    assert made.after == ("stop", "likely", stage.best) and (made.nearest, made.linearised) == (stage.best, "at")
    assert made.remainder is None and made.held_out == (4,) and made.predictions == ("before", "told")
    assert made.before is stage.start and made.laws == () and stage.told == [("distinguishing look-alikes", 0.8)]


def test_what_is_left_is_told_of_the_model_with_what_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Any = Stage(monkeypatch, Fit(DRAG), left=(1,)).explained()
    assert made.verdict is Verdict.PARTLY_EXPLAINED and not made.explained
    assert made.remainder == ("remainder", made.nearest, "misfit 1")


def test_effects_that_do_not_pass_only_imitate_what_the_model_before_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch, Fit(DRAG, TILT), left=(2,), doubtful=(DRAG, TILT))
    made: Any = stage.explained()
    assert made.verdict is Verdict.UNEXPLAINED and made.effects == () and made.after is stage.start
    assert [one.effect for one in made.imitations] == [DRAG, TILT]
    assert made.remainder == ("remainder", stage.start, "misfit 2", [DRAG, TILT])
    clean: Any = Stage(monkeypatch, Fit()).explained()
    assert clean.verdict is Verdict.ADEQUATE and clean.remainder is None and clean.imitations == ()
    rest: Any = Stage(monkeypatch, Fit(), left=(0,)).explained()
    assert rest.verdict is Verdict.UNEXPLAINED and rest.remainder == ("remainder", rest.nearest, "misfit 0")


@pytest.mark.parametrize("predictions", [("before", "told"), None])
def test_an_effect_that_a_residual_leaves_in_doubt_is_taken_out_by_itself(
    predictions: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(monkeypatch, Fit(DRAG, TILT, ARM), left=(3,), doubtful=(TILT,))
    made: Any = stage.explained(predictions)
    assert made.verdict is Verdict.EFFECT_FOUND and [one.effect for one in made.effects] == [DRAG, ARM]
    assert made.nearest.effects == (DRAG, ARM) and made.linearised == ("linear", (DRAG, ARM))
    assert all(one.evidence == {"count": 2.0} for one in made.effects)
    again = ((DRAG, ARM), (4,), "noise of 2", "stop")
    assert made.predictions == (None if predictions is None else ("before", again))
    monkeypatch.setattr(module, "predict", lambda *_: None)
    assert stage.explained(predictions).predictions is None
    # the fit that was predicted is the one that is left
    known = Fit(DRAG, ARM)
    monkeypatch.setattr(stage, "without", lambda *_: known)
    monkeypatch.setattr(module, "without", lambda *_: known)
    assert stage.explained(predictions, known).predictions == predictions


def test_where_nothing_is_left_or_nothing_can_be_taken_out_doubt_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calm = Stage(monkeypatch, Fit(DRAG, TILT), doubtful=(TILT,), left=(0,))
    assert calm.explained().nearest is calm.best
    stuck = Stage(monkeypatch, Fit(DRAG, TILT), left=(2,), doubtful=(TILT,))
    stuck.nothing_without = (TILT,)
    assert stuck.explained().nearest is stuck.best
    refused = Stage(monkeypatch, Fit(DRAG, TILT), left=(2,), named=False)
    assert refused.explained().nearest is refused.best


def test_an_effect_that_gains_no_more_than_chance_is_dropped_where_nothing_is_missing_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clean = Stage(monkeypatch, Fit(DRAG), named=False)
    made: Any = clean.explained()
    assert made.verdict is Verdict.ADEQUATE and made.nearest is made.after is clean.start
    assert (made.effects, made.imitations, made.remainder, made.linearised) == ((), (), None, ("linear", ()))
    assert made.predictions == ("before", ((), (4,), "noise of 0", "stop"))
    lacking = Stage(monkeypatch, Fit(DRAG), named=False, left=(0,))  # without it something is
    made = lacking.explained()
    assert made.verdict is Verdict.UNEXPLAINED and made.nearest is lacking.best and made.imitations
    unsure = Stage(monkeypatch, Fit(DRAG), named=False)
    unsure.best.converged = False
    assert unsure.explained().verdict is Verdict.UNEXPLAINED


def test_the_evidence_of_an_effect_is_complete(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(module, "without", lambda *given: asked.append(given) or Fit(bic=130.0))
    monkeypatch.setattr(module, "indistinguishable_effects", lambda *given: asked.append(given) or ((ARM,), 12.0))
    monkeypatch.setattr(module, "missed_without", lambda best, fewer: fewer.bic - 110.0)
    trail: Any = SimpleNamespace(raise_if_cancelled=lambda: asked.append("go on"))
    far: Any = SimpleNamespace(snr=30.0, from_other={TILT: 9.0, ARM: 4.0})
    best: Any = Fit(DRAG, TILT)
    given: Any = (best, DRAG, {"p": 1}, "residual", far, trail)
    made = module._found(*given)
    assert made == FoundEffect(
        DRAG, {"p": 1}, {"snr": 20.0, "delta_bic": -30.0, "least_separation": 4.0, "lead_over_runner_up": 12.0}, (ARM,)  # type: ignore[dict-item]
    )  # fmt: skip
    assert asked == ["go on", (best, DRAG, trail), (best, DRAG, "residual", far, trail)]
    far.snr, far.from_other = 10.0, {}
    assert module._found(*given).evidence["snr"] == 10.0
    assert module._found(*given).evidence["least_separation"] == 0.0
