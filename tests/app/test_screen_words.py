"""No string on the screen or on paper has the words that an English physicist found odd (docs: STYLE, Words)."""

import re

import pytest

from tests.app.screen_words import shown

BANNED = (  # (pattern, what to say)
    (r"foretell|foretold", "predict"),
    (r"put to the test|put .* to the test", "test a model's predictions"),
    (r"leaves? (far )?(more|less|over)|left over|leftover", "residual"),
    (r"\bheld[- ]out\b", "validation shots"),
    (r"lacks something: diagnose", "misfit exceeds noise: run Diagnose"),
    (r"\bboth agree\b", "quasi-static and impulse COR agree"),
    (r"\+ nothing\b", "no added effects"),
    (r"(pm|nm|V) a (sample|count)\b", "per sample, per count"),
    (r"could not show", "detection limits"),
    (r"kept from before|as version .* made it", "cached result"),
    (r"moves as neither|lacking law", "unmodelled effect"),
    (r"which channel is which|asked for once", "assign channels"),
    (r"some are kept clear", "disk reserve required"),
    (r"\bthis is a law\b|keep it and diagnose|\beach shot's own$", "formula is valid; fitted per shot"),
    (r"\bf against (place|speed|deflection)\b|\bagainst place\b", "force vs position"),
    (r"cannot be told from|cannot tell it from", "indistinguishable from"),
    (r"support that gives|inside the block|of bristles|changes towards rest|differs between both", "the field's name"),
    (r"one name is left|none agrees", "resolved: one candidate remains"),
    (r"shot that tells|shot would tell", "the deciding shot"),
    (r"what shook the path|struck the table", "vibration of the path; the table was struck"),
    (r"all is well|\bmend\b|nothing to judge", "ready; fix; nothing to check"),
    (r"in vain\b", "without success"),
    (r"\bis no (recording|object|law|number)\b", "is not a"),
    (r"the memory for it", "not enough memory"),
)


@pytest.mark.parametrize(("pattern", "instead"), BANNED, ids=[pattern[:30] for pattern, _ in BANNED])
def test_no_odd_word_is_shown(pattern, instead):
    found = [w for w in shown() if re.search(pattern, w.text, re.IGNORECASE)]
    assert not found, f"say {instead!r}: " + "; ".join(f"{w.file}:{w.line} {w.text!r}" for w in found)


def test_the_page_of_strings_finds_what_is_shown_and_no_docstring():
    texts = {words.text for words in shown()}
    assert "Open recordings …" in texts and "Waiting for the light switch: push the block.{}{}" in texts
    assert not any(text.startswith("Every command in one table") for text in texts)
    assert len(texts) > 600
