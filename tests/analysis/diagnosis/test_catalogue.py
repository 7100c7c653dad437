"""Every effect of the model's catalogue is one that the diagnosis tries, by the same function."""

import re

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.inference.model.free_parameters import trial_effects
from tests.pages import check_part, page


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
    """What an effect adds and where it shows is written by hand; ``make screen`` begins the row of a new one."""
    kept = page("catalogue.md").partition("|---|---|---|---|---|\n")[2].partition("\n\n")[0]
    written = {cells[1].strip("` "): cells for line in kept.splitlines() if (cells := line.split("|"))}
    rows = []
    for name, effect in CATALOGUE.items():
        alike = ", ".join(other.replace("_", " ") for other in effect.look_alikes) or "none near"
        adds, told, shows, others = written.get(name, f"|| {effect.words} || – | {alike} |".split("|"))[2:6]
        if re.findall(r"`(\w+)`", told) != [parameter.name for parameter in effect.parameters]:
            each = [f"`{parameter.name}`" + " (a shot)" * parameter.own for parameter in effect.parameters]
            told = f" {', '.join(each)} "
        rows.append(f"| `{name}` |{adds}|{told}|{shows}|{others}|")
    check_part("catalogue.md", kept, "\n".join(rows))
