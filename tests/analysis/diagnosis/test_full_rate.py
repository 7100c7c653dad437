"""A ripple finer than the averaged samples is asked at the record's rate."""

import pytest

from analysis.collision.effects import named
from analysis.diagnosis.search.forward_selection import Trail
from analysis.diagnosis.search.full_rate import at_full_rate
from analysis.inference.fit.samples import FINE_RATE_HZ, RATE_HZ
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

RIPPLE = "cyclic_error"


def test_a_ripple_too_weak_for_averaged_samples_is_seen_at_the_records_rate() -> None:
    motions = shots({RIPPLE: {"amplitude_m": 1.5e-10, "order": 2.0}})
    before = base_fit(motions)
    found = at_full_rate(before, Trail(before, list(KINDS.values()), calm), motions)
    assert found is not None
    best, _ = found
    assert best.effects == (named(RIPPLE),)
    assert best.hypothesis.data.shots[0].spacing_s == pytest.approx(1 / FINE_RATE_HZ)
    assert before.hypothesis.data.shots[0].spacing_s == pytest.approx(1 / RATE_HZ)
    clean = shots({})
    alone = base_fit(clean)
    assert at_full_rate(alone, Trail(alone, list(KINDS.values()), calm), clean) is None
