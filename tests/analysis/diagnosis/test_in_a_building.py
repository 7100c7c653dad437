"""The diagnosis on a rig that knows nothing of the analysis, in buildings of several curves, its path wandering."""

import math

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.residual import residual_of
from analysis.diagnosis.findings.result import Freedom, Verdict
from analysis.inference import Fitted, averaged_shots, base_fit, first_fit, frame_motions_of, joint_data, site_under
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


def base_in(rig: Rig) -> Fitted:
    """Return the base model's fit to three shots of a rig, the frame as their flights show it."""
    motions = rig.shots(31, (0.2, 0.265, 0.33))
    site = site_under(motions, frame_motions_of(motions, "paper", None), 20.0)
    shots = averaged_shots(motions)
    begin = first_fit(shots, "paper", site, lambda: False)
    return base_fit(joint_data(shots, begin, site), begin, lambda: False, ())


def test_strengths_learned_from_a_residual_hide_no_law_of_the_place() -> None:
    """A magnet of 1 mN at VC-C is a hundred noise norms: the learned frame absorbs it, that of the flights does not."""
    clean, pushed = (base_in(Rig("VC-C").with_bodies(magnet_n=force_n)) for force_n in (0.0, 1e-3))
    power = [math.exp(fitted.noise.site[0]) for fitted in (clean, pushed)]
    assert power[0] < 5 and power[1] > 50  # of the slowest motion, over what the flights show
    assert (
        pushed.chi2(pushed.noise) < 1.05 * pushed.samples < 1.15 * pushed.samples < pushed.chi2(pushed.unlearned_noise)
    )
    assert not residual_of(clean, clean.linearise()).significant
    missed = residual_of(pushed, pushed.linearise())
    assert missed.significant and missed.misfit.shape in (Freedom.PLACE, Freedom.BEND)


@pytest.mark.slow
@pytest.mark.parametrize("site", ["VC-A", "VC-E"])
def test_a_law_of_the_place_is_learned_in_a_building(site: str) -> None:
    found = diagnose(Rig(site).with_bodies(magnet_n=1e-3).shots(31, (0.2, 0.24, 0.28, 0.33)), seconds=600.0)
    assert found.verdict is Verdict.LAW_LEARNED and not found.effects
    (law,) = found.laws
    assert (law.argument, law.form) == ("place", "falling exponential")
    for name, true in (("a", 1e-3), ("b", 2e-3)):
        told, _ = law.parameters[name]
        assert told.std < 0.05 * true
        assert abs(told.value - true) < 3 * told.std


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
