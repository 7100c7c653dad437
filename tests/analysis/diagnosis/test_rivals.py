"""A look-alike is fitted in an effect's place, and takes it where it does better."""

import pytest

from analysis.diagnosis.compare import Fitted, fit
from analysis.diagnosis.diagnose import LEAST_LEAD
from analysis.diagnosis.explore import Trail, refit
from analysis.diagnosis.floor import Floor
from analysis.diagnosis.hypothesis import Hypothesis, Rig
from analysis.diagnosis.knobs import kinds
from analysis.diagnosis.ripple import RIPPLE, seen_finely
from analysis.diagnosis.rivals import challenged
from analysis.diagnosis.samples import FINE_RATE_HZ, RATE_HZ, together
from analysis.diagnosis.screen import projector, scores
from analysis.model.fitting import base_named, fit_shots
from analysis.motion import Motion
from tests.analysis.diagnosis.shots import shots

KINDS = {kind.name: kind for kind in kinds()}


def calm() -> bool:
    return False


def base_fit(motions: tuple[Motion, ...]) -> Fitted:
    rig = Rig(together(motions), base_named("paper"))
    hypothesis = Hypothesis(rig, ())
    given = fit_shots(motions)
    values = [given.parameters[name].value for name in rig.base.names]
    own = [[s.velocity_in_m_per_s.value, s.touch_time_s.value, s.offset_m.value] for s in given.shots]
    z = hypothesis.coordinates.to_search([*values, *(x for shot in own for x in shot)])
    return fit(hypothesis, z, Floor(5e-11, (0.0, 0.0), (1e-2, 1e-2), rig.shots[0].spacing_s))


def test_the_better_of_two_look_alikes_takes_the_place() -> None:
    true, first = "viscoelastic_arm", "plate_damping"
    before = base_fit(shots({true: {"stiffness_n_per_m": 0.02, "relaxation_time_s": 2e-3}}))
    at = projector(before)
    wrong = refit(at, KINDS[first], scores(at, KINDS[first])[0].start, calm)
    assert wrong is not None
    trail = Trail()
    trail.keep(before)
    trail.keep(wrong)
    catalogue = [KINDS[true], KINDS[first]]
    best, _, far = challenged(before, wrong, projector(wrong), catalogue, trail, lambda _: True, calm)
    assert best.names == (true,) and best.bic < wrong.bic - LEAST_LEAD
    assert list(far) == [true]
    kept, _, _ = challenged(before, wrong, projector(wrong), catalogue, trail, lambda _: False, calm)
    assert kept is wrong  # what does not foretell a held-out shot takes no place


def test_a_ripple_too_weak_for_averaged_samples_is_seen_at_the_records_rate() -> None:
    motions = shots({RIPPLE: {"amplitude_m": 1.5e-10, "order": 2.0}})
    before = base_fit(motions)
    found = seen_finely(before, before, Trail(), motions, list(KINDS.values()), calm)
    assert found is not None
    _, best, _ = found
    assert best.names == (RIPPLE,)
    assert best.hypothesis.rig.shots[0].spacing_s == pytest.approx(1 / FINE_RATE_HZ)
    assert before.hypothesis.rig.shots[0].spacing_s == pytest.approx(1 / RATE_HZ)
    clean = shots({})
    alone = base_fit(clean)
    assert seen_finely(alone, alone, Trail(), clean, list(KINDS.values()), calm) is None
