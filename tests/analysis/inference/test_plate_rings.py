"""A plate that still swings from the shot before: a single fit takes it to be at rest, and says where it is not."""

import pytest

from analysis.inference.fit.shot_fit import fit_shots
from analysis.shot.consistency import concerning
from tests.building_rig import Path, Rig

QUIET = Rig(site="", path=Path(white_m=0.1e-9, wander_m=0.05e-9))


def flags(rig: Rig, seed: int) -> tuple[str, ...]:
    return fit_shots(rig.shots(seed, (0.265,))).flags


@pytest.mark.parametrize("ring_m", [1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_ring_is_told_at_the_numbers_that_it_spoils(ring_m: float, seed: int) -> None:
    rig = Rig(site="", path=QUIET.path, ring_m=ring_m)
    assert concerning("plate_mass_kg", flags(rig, seed)) == ("plate_rings",)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_plate_at_rest_is_not_said_to_ring(seed: int) -> None:
    assert flags(QUIET, seed) == ()


@pytest.mark.parametrize("lacks", [{"friction_n": 1e-7}, {"friction_n": 9e-5}, {"cubic_n_per_m3": 3e5}])
def test_what_the_model_lacks_is_not_taken_for_a_ring(lacks: dict[str, float]) -> None:
    assert "plate_rings" not in flags(QUIET.with_bodies(**lacks), 3)


def test_a_fit_that_lets_the_plate_swing_says_nothing() -> None:
    rig = Rig(site="", path=QUIET.path, ring_m=1e-6)
    assert fit_shots(rig.shots(1, (0.265,)), effects=("plate_motion",)).flags == ()
