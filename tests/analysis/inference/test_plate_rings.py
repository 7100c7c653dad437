"""A plate that still swings from the shot before: a single fit takes it to be at rest, and says where it is not."""

import numpy as np
import pytest

from analysis.inference.fit.as_fit import _has_transient_excess
from analysis.inference.fit.shot_fit import fit_shots
from analysis.shot.consistency import flags_affecting
from tests.building_rig import Path, Rig

QUIET = Rig(site="", path=Path(white_m=0.1e-9, wander_m=0.05e-9))


def flags(rig: Rig, seed: int) -> tuple[str, ...]:
    return fit_shots(rig.shots(seed, (0.265,))).flags


@pytest.mark.parametrize("ring_m", [1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_ring_is_told_at_the_numbers_that_it_spoils(ring_m: float, seed: int) -> None:
    rig = Rig(site="", path=QUIET.path, ring_m=ring_m)
    assert flags_affecting("plate_mass_kg", flags(rig, seed)) == ("plate_rings",)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_plate_at_rest_is_not_said_to_ring(seed: int) -> None:
    assert flags(QUIET, seed) == ()


@pytest.mark.parametrize("lacks", [{"friction_n": 1e-7}, {"friction_n": 9e-5}, {"cubic_n_per_m3": 3e5}])
def test_what_the_model_lacks_is_not_taken_for_a_ring(lacks: dict[str, float]) -> None:
    assert "plate_rings" not in flags(QUIET.with_bodies(**lacks), 3)


def test_a_fit_that_lets_the_plate_swing_says_nothing() -> None:
    rig = Rig(site="", path=QUIET.path, ring_m=1e-6)
    assert fit_shots(rig.shots(1, (0.265,)), effects=("plate_motion",)).flags == ()


@pytest.mark.parametrize("quiet", [1.0, 0.3])  # noise may be smaller than it was thought to be
@pytest.mark.parametrize(
    ("loud", "share", "said"),
    [
        (1.0, 0.0, False),
        (2.3, 0.1, True),  # times the noise's power, in a tenth of the windows: eleven standard deviations each
        (1.4, 0.1, False),  # four: of a hundred windows, and of a hundred shots, some do by chance
        (9.0, 0.35, True),
        (9.0, 0.48, False),  # half of the record is no moment: the model lacks something
        (9.0, 1.0, False),
    ],
)
def test_a_ring_is_louder_than_chance_and_for_a_moment_alone(
    loud: float, share: float, said: bool, quiet: float
) -> None:
    residual = np.random.default_rng(3).normal(0.0, np.sqrt(quiet), 100 * 150)
    residual[: round(share * residual.size)] *= np.sqrt(loud)
    assert _has_transient_excess(residual) is said
