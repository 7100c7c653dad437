"""Follow docs/change-a-verdict-rule.md with the code that stands there: a rule and its test are all that is written."""

import ast
import inspect
import re
import types
from dataclasses import fields, replace
from typing import Any

import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.findings import criteria, words
from analysis.diagnosis.findings.result import FoundEffect, Verdict
from analysis.diagnosis.verdict import acceptance
from analysis.shot.quantity import Quantity
from tests.analysis.diagnosis import test_conclusion
from tests.app import synthetic
from tests.pages import DOCS, code_blocks, page

PAGE = "change-a-verdict-rule.md"


@pytest.fixture
def changed() -> Any:
    """Return ``conclude`` with the page's rule."""
    rule, (old, new) = code_blocks(PAGE)[0], code_blocks(PAGE, "diff")[0].splitlines()
    source = inspect.getsource(acceptance)
    assert source.count(f"\n{old[1:]}\n") == 1
    source = source.replace(f"\n{old[1:]}\n", f"\n{new[1:]}\n").replace("\ndef conclude(", f"\n{rule}\n\ndef conclude(")
    module = types.ModuleType("with_the_rule")
    exec(compile(source, "acceptance.py", "exec"), module.__dict__)
    return module.conclude


def the_pages_test(conclude: Any) -> None:
    """Run the test of the page, as it would stand in ``test_conclusion.py``."""
    names = vars(test_conclusion) | {"conclude": conclude}
    text = code_blocks(PAGE)[1]
    exec(compile(text, "test_conclusion.py", "exec"), names)
    (test,) = (node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef))
    names[test]()


def test_the_pages_test_fails_without_the_rule_and_passes_with_it(changed: Any) -> None:
    with pytest.raises(AssertionError):
        the_pages_test(acceptance.conclude)
    the_pages_test(changed)


def test_all_that_was_concluded_before_still_is(changed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_conclusion, "conclude", changed)
    was = test_conclusion.test_the_verdict_follows_from_what_is_named_and_what_remains
    for case in was.pytestmark[0].args[1]:
        was(*case)


def test_the_verdict_has_the_words_of_the_page() -> None:
    vague = FoundEffect(effect_named("tilt"), {"angle_rad": Quantity(1e-4, 5e-5)}, {"snr": 40.0})
    diagnosis = synthetic.diagnosis(synthetic.shot())
    found = replace(diagnosis, verdict=Verdict.PARTLY_EXPLAINED, effects=(vague,), remainder=None)
    (said,) = re.findall(r'says "(.*?)"', page(PAGE))
    begin, end = said.split("...")
    sentence = words.sentence(found)
    assert sentence.startswith(begin) and end in sentence


def test_the_pages_threshold_is_a_field_with_all_that_the_table_shows() -> None:
    names = dict(vars(criteria))
    exec(f"@dataclass(frozen=True, slots=True)\nclass More(Criteria):\n    {code_blocks(PAGE)[2]}", names)
    threshold = fields(names["More"])[-1]
    assert threshold.default == 3.0 and set(threshold.metadata) == {"unit", "meaning", "source"}
    assert "> 3.0 * size.std" in code_blocks(PAGE)[0]


def test_what_the_page_names_is_there() -> None:
    house = DOCS.parent
    for function, path in re.findall(r"`(\w+)` in `(diagnosis/\S+\.py)`", page(PAGE)):
        assert re.search(rf"^(def|class) {function}\b", (house / "analysis" / path).read_text(encoding="utf-8"), re.M)
    for name in re.findall(r"`(test_\w+\.py)`", page(PAGE)):
        assert (house / "tests" / "analysis" / "diagnosis" / name).is_file(), name
    for name in ("_pass", "without_unpredictive_effects", "without_faint_effects"):
        assert name in page(PAGE) and hasattr(acceptance, name)
