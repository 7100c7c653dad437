"""The thresholds: documented as they are, and the price of an effect that follows the catalogue's length."""

import math
import re
from dataclasses import fields
from pathlib import Path

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.search.forward_selection import Trail
from tests.pages import check_part, page

PAGE = "how-a-diagnosis-decides.md"


def test_the_page_lists_every_threshold_as_it_is() -> None:
    columns = ("unit", "meaning", "source")
    rows = [
        (f"`{one.name}`", f"{getattr(CRITERIA, one.name):g}", *map(one.metadata.__getitem__, columns))
        for one in fields(CRITERIA)
    ]
    assert all(all(cell.strip() for cell in row) for row in rows)
    tried = len(CATALOGUE)
    fall, wandering = CRITERIA.fall(tried), CRITERIA.fall(tried, wandering=True)
    head = [
        f"The best of the {tried} effects of the catalogue must lower the criterion by {fall:.1f}, and by "
        f"{wandering:.1f} where the floor still wanders.",
        "",
        "| name | value | unit | meaning | where it comes from |",
        "|---|---|---|---|---|",
    ]
    now = "\n".join([*head, *(f"| {' | '.join(row)} |" for row in rows)])
    (kept,) = re.findall(r"^## The thresholds\n\n(.*?)\n\n## ", page(PAGE), re.DOTALL | re.MULTILINE)
    check_part(PAGE, kept, now)


def test_what_the_page_says_in_words_is_what_the_table_says() -> None:
    prose = " ".join(page(PAGE).split())
    said = {
        f"{CRITERIA.least_fall:g} + {CRITERIA.cost_of_choice:g} ln N, because",
        f"by {CRITERIA.wandering_fall:g} more where the floor still wanders",
        f"a single effect at least {CRITERIA.stands_out:g} noise norms",
        f"each of two {CRITERIA.one_of_two:g}, each of three {CRITERIA.one_of_three:g}",
        f"lower the criterion by {CRITERIA.several_fall:g}",
        f"leaves less than {CRITERIA.separation:g} noise norms",
        f"within {CRITERIA.least_lead:g} of the criterion, or within {CRITERIA.least_lead / 2:g} of the log-likelihood",
        f"lower the criterion by {CRITERIA.least_fall:g} + {CRITERIA.cost_of_choice:g} ln(tried). It must lower by "
        f"{100 * CRITERIA.drive_gain:g} % the force error of prediction",
        f"A pair must lead its better half by {CRITERIA.least_lead:g}.",
        f"each law must lower the criterion by {CRITERIA.least_lead:g} and the error of prediction by "
        f"{100 * CRITERIA.drive_gain:g} %",
        f"A residual up to {CRITERIA.drive_explained:g} times the repeatability",
    }
    assert {words for words in said if words not in prose} == set()


@pytest.mark.parametrize("tried", [1, 19, 60])
def test_an_effect_of_a_longer_catalogue_pays_more(tried: int) -> None:
    class Nothing:
        effects: tuple[str, ...] = ()
        bic = 0.0

    trail = Trail(Nothing(), [None] * tried, lambda: False)  # type: ignore[arg-type, list-item]
    assert trail.least_fall() == pytest.approx(10 + 2 * math.log(tried))


# Where an effect's name may stand: its row and what is said of it in words.  Beyond: a plate's motion is a state at the
# touch, which the integrators take by name, and a driven slider has a catalogue and words of its own.
ROWS = {f"analysis/collision/effects/{name}.py" for name in ("on_block", "on_plate", "in_contact", "on_sensor")}
WORDS = {"analysis/diagnosis/findings/words.py"}
ALLOWED = (
    ROWS
    | WORDS
    | {
        "analysis/drive/catalogue.py",
        "analysis/diagnosis/findings/driven_words.py",
        "analysis/diagnosis/findings/contact_laws.py",
    }
)


def test_no_effect_is_named_outside_its_row_and_its_words() -> None:
    house = Path(__file__).parents[3]
    found = set()
    for source in (house / "analysis").rglob("*.py"):
        path = source.relative_to(house).as_posix()
        text = source.read_text(encoding="utf-8")
        for name in CATALOGUE:
            if path not in ALLOWED and name != "plate_motion" and re.search(rf'"{name}["]', text):
                found.add((path, name))
    assert found == set()


@pytest.mark.parametrize(("rounds", "most"), [(0, 0.0), (1, 100.0), (2, 300.0), (3, 700.0)])
def test_each_further_round_is_within_reach_of_as_much_as_all_before_it(rounds: int, most: float) -> None:
    assert may_beat(-200.0 - most + 1.0, -200.0, -100.0, rounds)
    assert not may_beat(-200.0 - most - 1.0, -200.0, -100.0, rounds)
