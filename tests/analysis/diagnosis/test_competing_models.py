"""A look-alike is fitted in an effect's place, and takes it where it does better."""

from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.evidence.identifiability import Separation, separation
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.competing_models import _nearest, with_look_alikes_tried
from analysis.diagnosis.search.forward_selection import Trail
from analysis.inference.fit.added_effect import refit
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_the_better_of_two_look_alikes_takes_the_place() -> None:
    true, first = "viscoelastic_arm", "plate_damping"
    before = base_fit(shots({true: {"stiffness_n_per_m": 0.02, "relaxation_time_s": 2e-3}}))
    at = before.linearise()
    wrong = refit(at, KINDS[first], at.scores(KINDS[first])[0].start, calm)
    assert wrong is not None
    trail = Trail(before, [KINDS[true], KINDS[first]], calm)
    trail.keep(wrong)
    best, _, far = with_look_alikes_tried(wrong, wrong.linearise(), trail, lambda _: True)
    assert best.effects == (effect_named(true),) and best.bic < wrong.bic - CRITERIA.least_lead
    assert list(far) == [effect_named(true)]
    kept, _, _ = with_look_alikes_tried(wrong, wrong.linearise(), trail, lambda _: False)
    assert kept is wrong  # what does not predict a held-out shot takes no place


def test_what_rings_in_the_same_place_is_asked_however_far_apart_it_is_to_first_order() -> None:
    true, first = "support_compliance", "second_plate_mode"
    effects = {true: {"compliance_m_per_n": 4.187e-5, "frequency_hz": 1506.9}}
    before = base_fit(shots(effects, seed=63001648))  # a rig on which such a clamp leaves 40 norms
    at = before.linearise()
    quick = refit(at, KINDS[first], at.scores(KINDS[first])[0].start, calm)
    assert quick is not None
    wrong = quick.refitted(evaluations=60)
    far = separation(wrong, wrong.linearise(), effect_named(first), [KINDS[true]])
    assert far.from_other[effect_named(true)] > 0.7 * far.snr  # a line so narrow that its twin beside it stands apart
    trail = Trail(before, [KINDS[true], KINDS[first]], calm)
    trail.keep(wrong)
    best, _, _ = with_look_alikes_tried(wrong, wrong.linearise(), trail, lambda _: True)
    assert best.effects == (effect_named(true),) and best.bic < wrong.bic


def test_a_look_alike_that_the_catalogue_names_is_fitted_where_others_stand_nearer_to_first_order() -> None:
    """In a building a strong damping was named an arm at its shortest relaxation time, and damping was not fitted."""
    names = ("support_compliance", "second_plate_mode", "plate_damping", "block_mode")
    far = Separation(94.2, dict(zip(effects_named(names), (42.26, 42.28, 44.44, 80.4), strict=True)), {})
    near = [
        kind.effect.name for kind in _nearest(effect_named("viscoelastic_arm"), far, [KINDS[name] for name in names])
    ]
    assert near == ["support_compliance", "second_plate_mode", "plate_damping"]
    further = Separation(70.0, far.from_other, {})  # what does less than half of the same is none
    kinds = list(KINDS.values())
    arm, damping = effect_named("viscoelastic_arm"), effect_named("plate_damping")
    # ... but for a simpler look-alike: the noise learned beside an arm of 99 norms held its damping 61 away
    assert "plate_damping" in [kind.effect.name for kind in _nearest(arm, further, kinds)]
    apart = Separation(70.0, {arm: 44.44}, {})
    assert [kind.effect.name for kind in _nearest(damping, apart, kinds)] == []
    assert [kind.effect.name for kind in _nearest(damping, Separation(80.0, {arm: 44.44}, {}), kinds)] == [arm.name]
