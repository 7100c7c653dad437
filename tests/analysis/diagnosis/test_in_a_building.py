"""The diagnosis on a rig that knows nothing of the analysis, in buildings of several curves, its path wandering."""

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.result import Verdict
from tests.benchmarks.site_cases import Case, judge
from tests.building_rig import Rig


@pytest.mark.parametrize(
    ("site", "speeds"),
    [
        # quicker: two shots at VC-D, in tests/analysis/uncertainty/test_noise_band.py
        pytest.param("VC-C", (0.2, 0.33), marks=pytest.mark.slow),
        pytest.param("VC-A", (0.2, 0.265, 0.33), marks=pytest.mark.slow),
        pytest.param("VC-G", (0.2, 0.265, 0.33), marks=pytest.mark.slow),
    ],
)
def test_a_clean_set_is_adequate_where_the_optical_path_wanders_too(site: str, speeds: tuple[float, ...]) -> None:
    found = diagnose(Rig(site).shots(11, speeds))
    assert found.verdict is Verdict.ADEQUATE
    assert not found.effects and not found.laws


@pytest.mark.slow  # quicker: friction is named in the bench's building, in tests/analysis/inference/test_site.py
def test_friction_is_named_beside_a_building_and_a_path_that_wanders() -> None:
    found = diagnose(Rig("VC-C").with_bodies(friction_n=1.2e-4).shots(102))
    assert found.verdict is Verdict.EFFECT_FOUND
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    force_n = found.effects[0].parameters["force_n"]
    assert force_n.std < 1e-5
    assert abs(force_n.value - 1.2e-4) < 3 * force_n.std


@pytest.mark.slow  # quicker: which look-alikes are fitted, in test_competing_models.py
def test_damping_of_the_plate_is_not_called_an_arm() -> None:
    """An arm at its shortest relaxation time is damping with a number more, and was found first."""
    found = diagnose(Rig("VC-C").with_bodies(plate_damping_n_s_per_m=4e-3).shots(93000362, (0.2, 0.265, 0.33)))
    assert [effect.name for effect in found.effects] == ["plate_damping"]
    coefficient = found.effects[0].parameters["coefficient_n_s_per_m"]
    assert abs(coefficient.value - 4e-3) < 3 * coefficient.std


@pytest.mark.slow
def test_noise_learned_in_a_wrong_valley_does_not_hold_the_search_there() -> None:
    """A lag draws contact and noise into a valley; what stood for it were a block mode and what no test passed."""
    said = judge(Case("VC-D", "demodulation_lag", 9815029511, 15.0), diagnose)
    assert said.score == "right", said.problem
