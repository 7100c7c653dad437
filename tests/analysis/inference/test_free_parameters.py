"""Effects in the form in which they are searched: what is free, what is tried, how strong."""

import pytest

from analysis.collision import CATALOGUE, NUISANCES
from analysis.collision.effects import effect_named
from analysis.inference.model.free_parameters import trial_effect, trial_effects, trials_of


def test_starts_are_all_combinations_of_what_is_tried() -> None:
    mode = trial_effect(effect_named("second_plate_mode"))
    mass, frequency, damping = mode.effect.parameters
    assert mode.starts == tuple(
        {"mass_kg": mass.tried[0], "frequency_hz": hertz, "damping_ratio": damping.tried[0]} for hertz in frequency.grid
    )
    assert trial_effect(effect_named("coulomb_friction")).starts == ({"force_n": 2e-5},)  # its natural size
    error = trial_effect(effect_named("cyclic_error"))
    assert [start["order"] for start in error.starts] == [1.0, 2.0]
    assert [p.name for p in error.shared] == ["amplitude_m"] and [p.name for p in error.own] == ["phase_rad"]
    assert error.fixed_in({"amplitude_m": 1.0, "order": 2.0, "phase_rad": 3.0}) == {"order": 2.0}
    assert mode.fixed_in(mode.starts[0]) == {} and mode.own == () and mode.shared == mode.free_parameters


@pytest.mark.parametrize(
    ("name", "values", "stronger"),
    [
        ("viscoelastic_arm", (0.5, 2e-3), (1.5, 2e-3)),
        ("second_plate_mode", (6.0, 900.0, 0.1), (2.0, 900.0, 0.1)),  # the heavier, the less it does
        ("plate_motion", (1.0, 2.0), (3.0, 6.0)),  # of each shot's own values all
    ],
)
def test_an_effect_is_three_times_as_strong(name: str, values: tuple[float, ...], stronger: tuple[float, ...]) -> None:
    kind = trial_effect(effect_named(name))
    names = [p.name for p in kind.effect.parameters]
    found = kind.times(dict(zip(names, values, strict=True)), 3.0)
    assert found == pytest.approx(dict(zip(names, stronger, strict=True)))
    assert kind.inverse is kind.effect.inverse


def test_all_effects_come_in_the_catalogues_order_and_further_ones_once_after_them() -> None:
    (nuisance,) = NUISANCES.values()
    tilt = effect_named("tilt")
    found = [kind.effect for kind in trial_effects((nuisance, tilt, nuisance))]
    assert found == [*CATALOGUE.values(), nuisance]
    assert [kind.effect for kind in trials_of([tilt, nuisance])] == [tilt, nuisance]
