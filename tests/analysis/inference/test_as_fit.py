"""A diagnosis' own fit beside the fit of the same model to the same shots."""

import pytest

from analysis.diagnosis.search.from_base import accept
from analysis.inference.fit.as_fit import as_fit
from analysis.inference.fit.shot_fit import fit_shots
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_the_velocity_out_is_that_after_the_last_release_with_its_own_uncertainty() -> None:
    name = "coulomb_friction"
    motions = shots({name: {"force_n": 2e-5}}, count=2)
    ours = as_fit(accept(base_fit(motions), list(KINDS.values()), (name,), calm), motions, "paper", 0.0)
    other = fit_shots(motions, effects=(name,))
    for mine, theirs in zip(ours.shots, other.shots, strict=True):
        out, reference = mine.velocity_out_m_per_s, theirs.velocity_out_m_per_s
        assert out.value == pytest.approx(reference.value, abs=reference.std)
        assert out.std == pytest.approx(reference.std, rel=0.4)
        # The velocities in and out hang together through restitution, but are not equally well known.
        assert out.std != pytest.approx(mine.velocity_in_m_per_s.std, rel=1e-3)
