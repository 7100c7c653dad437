"""Every effect of the model's catalogue is one that the diagnosis tries, by the same function."""

import re
from pathlib import Path

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.inference.fit.free_parameters import trial_effects


def test_the_diagnosis_tries_what_the_catalogue_holds() -> None:
    tried = {kind.effect.name: kind for kind in trial_effects()}
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


def test_the_page_of_the_catalogue_lists_every_effect_with_its_parameters() -> None:
    page = (Path(__file__).parents[3] / "docs" / "catalogue.md").read_text(encoding="utf-8")
    rows = {cells[1].strip("` "): cells[3] for line in page.splitlines() if (cells := line.split("|"))[1:2]}
    for effect in CATALOGUE.values():
        told = [parameter.name for parameter in effect.parameters]
        assert re.findall(r"`(\w+)`", rows[effect.name]) == told
