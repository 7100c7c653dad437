"""Every effect of the model's catalogue is one that the diagnosis tries, by the same function."""

import re
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.free_parameters import trial_effect, trial_effects
from analysis.diagnosis.quick_shot import Optics, respond
from analysis.model import general
from analysis.model.effects import CATALOGUE
from analysis.model.parameters import PAPER

TIME_S = np.arange(5000) * 1e-5
OWN = np.array([-0.265, 0.0101234, 0.0])


def test_the_diagnosis_tries_what_the_catalogue_holds() -> None:
    tried = {kind.name: kind for kind in trial_effects()}
    assert list(tried) == list(CATALOGUE)
    for name, effect in CATALOGUE.items():
        kind = tried[name]
        assert {free.name for free in kind.free_parameters} == {p.name for p in effect.parameters if not p.fixed}
        assert set(kind.amplitude) <= {free.name for free in kind.free_parameters}
        for start in kind.starts:
            assert set(start) == {p.name for p in effect.parameters}
            for free in kind.free_parameters:
                assert free.lower <= start[free.name] <= free.upper
                assert free.to_value(free.to_search(start[free.name])) == pytest.approx(start[free.name], rel=1e-12)


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if e.kernel is not None and e.range_at < 0])
def test_a_start_of_the_diagnosis_is_the_models_motion(name: str) -> None:
    effect = CATALOGUE[name]
    starts = trial_effect(effect).starts
    values = starts[len(starts) // 2]
    quick = respond(TIME_S, PAPER.vector[:4], OWN, {name: values}, PAPER.block_mass_kg, Optics(632.8e-9, 1e5))
    active = general.Active(effect, tuple(values[p.name] for p in effect.parameters))
    exact = general.solve(PAPER, [active], TIME_S - OWN[1])
    np.testing.assert_allclose(quick.displacement_m, exact.displacement_m, atol=3e-11)


def test_the_page_of_the_catalogue_lists_every_effect_with_its_parameters() -> None:
    page = (Path(__file__).parents[3] / "docs" / "catalogue.md").read_text(encoding="utf-8")
    rows = {cells[1].strip("` "): cells[3] for line in page.splitlines() if (cells := line.split("|"))[1:2]}
    for effect in CATALOGUE.values():
        told = [parameter.name for parameter in effect.parameters if not parameter.nuisance]
        assert re.findall(r"`(\w+)`", rows[effect.name]) == told
