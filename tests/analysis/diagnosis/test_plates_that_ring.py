"""A set of shots on a quiet table, each struck while the plate still swings from the shot before it."""

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from tests.building_rig import Path, Rig

TRUE = Rig().bodies


@pytest.mark.parametrize("ring_m", [1e-8, 1e-7, 1e-6])
def test_plates_that_ring_are_named_and_nothing_else(ring_m: float) -> None:
    """No shot can foretell another's plate: the base that has none is drawn far off, and foretells with a wide ±."""
    shots = Rig(site="", path=Path(white_m=0.1e-9, wander_m=0.0), ring_m=ring_m).shots(1)
    told = diagnose(shots)
    assert [effect.name for effect in told.effects] == ["plate_motion"]
    assert not told.laws and not told.effects[0].indistinguishable_from
    for name, true in (
        ("plate_stiffness_n_per_m", TRUE.plate_n_per_m),
        ("plate_mass_kg", TRUE.plate_kg),
        ("contact_stiffness_n_per_m", TRUE.contact_n_per_m),
    ):
        fitted = told.fit_after.parameters[name]
        assert abs(fitted.value - true) < 4.0 * fitted.std
