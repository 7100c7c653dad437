"""A second flight so short that the block only grazes the plate is not read as if it were well seen."""

from dataclasses import replace

import pytest

from analysis.pipeline import analyse
from analysis.shot.quantity import Quantity
from instrument.bench.mechanics import Bodies, collide
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import record_shot

USUAL = Bodies()


@pytest.mark.parametrize("louder", [1.04, 1.13, 1.15, 1.152])
def test_a_flight_that_hardly_is_one_is_less_sure(louder: float) -> None:
    bodies = replace(USUAL, contact_damping_n_s_per_m=louder * USUAL.contact_damping_n_s_per_m)
    events = collide(-0.265, bodies=bodies).events
    touches, releases = ([time for what, time in events if what == kind] for kind in ("touch", "release"))
    true = (touches[2] - releases[1]) / (touches[1] - releases[0])
    shot = analyse(record_shot(Bench(bodies=bodies, seed=2), 0, 0.265, 10e6, 0.06)[0])
    assert shot.impact is not None
    reading = shot.impact.cor_kinetic.flights
    assert isinstance(reading, Quantity)
    assert abs(reading.value - true) < 2.5 * reading.std < 0.12
