"""First guesses: the same for every scale of the rig, whatever the record lacks, and cheap where it is plain."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.parameters import PAPER, Collision
from analysis.inference.fit.base import base_named
from analysis.inference.fit.first_guesses import Guess, first_guesses, rank
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.samples import averaged_shot
from tests.analysis.collision.simulated import shot

BASE = base_named("paper")
RATE_HZ = 1e5  # of the record: nothing is averaged


def ranked(collision: Collision, gap: slice | None = None) -> list[Guess]:
    whole = averaged_shot(shot(collision, white_m=1e-10), RATE_HZ)
    valid = whole.valid.copy()
    if gap is not None:
        valid[gap] = False
    return rank(replace(whole, displacement_m=np.where(valid, whole.displacement_m, np.nan), valid=valid), BASE)


def test_a_rig_of_another_scale_has_the_same_pattern_of_bounces() -> None:
    heavy = replace(
        PAPER,
        plate_stiffness_n_per_m=2 * PAPER.plate_stiffness_n_per_m,
        contact_stiffness_n_per_m=2 * PAPER.contact_stiffness_n_per_m,
        plate_mass_kg=0.5 * PAPER.plate_mass_kg,
        block_mass_kg=0.5 * PAPER.block_mass_kg,
        velocity_in_m_per_s=2 * PAPER.velocity_in_m_per_s,
    )  # twice as fast a swing, the same ratios
    one, other = ranked(PAPER)[0], ranked(heavy)[0]
    ratios = [g.collision.contact_stiffness_n_per_m / g.collision.plate_stiffness_n_per_m for g in (one, other)]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-9)
    shares = [g.collision.plate_mass_kg / g.collision.block_mass_kg for g in (one, other)]
    assert shares[0] == pytest.approx(shares[1], rel=1e-9)
    assert other.left_m == pytest.approx(one.left_m, rel=0.02)  # half the time at twice the speed
    assert one.collision.plate_mass_kg == pytest.approx(PAPER.plate_mass_kg, rel=0.6)


def test_a_gap_in_contact_is_left_out_not_filled() -> None:
    whole = ranked(PAPER)
    touch = int(0.0123456 * RATE_HZ)
    torn = ranked(PAPER, slice(touch + 900, touch + 1300))
    assert torn[0].collision == whole[0].collision
    assert torn[0].left_m < 2 * whole[0].left_m


def test_one_search_is_enough_where_the_pattern_of_bounces_is_plain(monkeypatch: pytest.MonkeyPatch) -> None:
    searches = []

    def counted(*arguments, **options):
        searches.append(arguments)
        return search(*arguments, **options)

    search = Problem.search
    monkeypatch.setattr(Problem, "search", counted)
    found = first_guesses(BASE, [averaged_shot(shot(PAPER))], lambda: False)
    assert len(searches) == 1
    assert found[0] == pytest.approx(PAPER.vector[:4], rel=1e-3)
