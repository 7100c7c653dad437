"""The search for several effects takes more than one way."""

from analysis.diagnosis.explore import another_way, explore
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_two_effects_that_look_like_a_third_are_found_by_another_way() -> None:
    true = {"bearing_gradient", "plate_damping"}
    motions = shots(
        {"bearing_gradient": {"stiffness_n_per_m": 1.3e-4}, "plate_damping": {"coefficient_n_s_per_m": 1.9e-6}}
    )
    before = base_fit(motions)
    catalogue = [KINDS[name] for name in (*true, "viscous_drag", "frame_vibration")]
    greedy, trail = explore(before, catalogue, calm, most=2)
    assert "viscous_drag" in greedy.names
    best = another_way(greedy, trail)
    assert set(best.names) == true and best.bic < greedy.bic - 100
