"""A law with a corner: its numbers are as good as its steps, and the last fit takes short ones."""

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from tests.law_rigs import LawRig

STIFFER_N_PER_M, FROM_M = 400.0, 1.5e-5


@pytest.mark.slow
def test_a_corner_of_the_overlap_is_learned_without_bias() -> None:
    """At a tenth of the usual noise, so that what steps over the corner miss is several standard deviations."""

    def force(x: float, _v: float, y: float, _u: float) -> float:
        return STIFFER_N_PER_M * max(0.0, y - x - FROM_M)

    rig = LawRig(noise_m=1e-11, seed=4, between=force, kinks=(lambda x, _v, y, _u: y - x - FROM_M,))
    told = diagnose(rig.shots([0.15, 0.3]))
    assert told.verdict is Verdict.LAW_LEARNED
    (law,) = told.laws
    assert (law.argument, law.form) == ("overlap", "hinge")
    for name, truth in (("a", STIFFER_N_PER_M), ("c", FROM_M)):
        known, _unit = law.parameters[name]
        assert abs(known.value - truth) < 3 * known.std, name
