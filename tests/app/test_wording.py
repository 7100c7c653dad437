"""Numbers as the screen states them."""

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale

from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import Remainder, Verdict
from analysis.shot.quantity import NotSeen, Quantity
from app.session.verdict_basis import verdict_of
from app.words import model_texts, wording
from app.words.flags import FLAGS
from app.words.wording import number, parameter_words
from tests.app import synthetic


@pytest.fixture
def german():
    before = QLocale()
    QLocale.setDefault(QLocale(QLocale.Language.German))
    yield
    QLocale.setDefault(before)


def test_not_seen_is_a_dash_with_its_reason_and_never_zero():
    assert wording.value_text(NotSeen("too short")) == "–"
    assert wording.concise_text(None) == "–"
    assert "too short" in wording.reading_tooltip("COR", NotSeen("too short"))


def test_value_and_uncertainty_are_scaled_and_rounded_together():
    assert wording.value_text(Quantity(19.1034e-3, 4.2e-5), 1e3) == "19.103 ± 0.042"
    assert wording.concise_text(Quantity(0.9875562, 2.1e-5)) == "0.987556(21)"
    assert wording.concise_text(Quantity(221.4, 0.0)) == "221.4"
    assert wording.concise_text(Quantity(10003.0, 61.0)) == "10003 ± 61"


def test_the_screen_follows_the_systems_decimal_sign(german):
    assert wording.value_text(Quantity(0.5119, 0.0012)) == "0,5119 ± 0,0012"
    assert wording.number(1.5) == "1,5"


def test_parameters_are_said_with_their_unit():
    words = wording.parameter_words("coefficient_n_s2_per_m2", Quantity(1.9e-3, 1e-4))
    assert words == "coefficient (1.90 ± 0.10)e-3 N s²/m²"
    assert wording.parameter_words("force_n", Quantity(2e-5, 1e-6)).endswith(" N")
    assert wording.parameter_words("damping_ratio", Quantity(0.1, 0.01)) == "damping ratio 0.100 ± 0.010"


def test_a_parameter_of_one_shot_says_which() -> None:
    assert parameter_words("phase_rad.2", Quantity(0.98, 0.2, "fit")) == "phase of shot 2 0.98 ± 0.20 rad"


def test_large_numbers_are_written_out_and_small_ones_are_short() -> None:
    assert (number(14930.0, 3), number(9.7e-6, 2), number(1e9, 3), number(-74990.0)) == (
        "14900",
        "9.7e-6",
        "1e9",
        "-74990",
    )


@pytest.mark.parametrize(
    ("value", "digits", "said"),
    [
        (999999.6, 6, "1000000"),
        (9999999.0, 3, "1e7"),
        (1234567.0, 3, "1230000"),
        (12.0, 3, "12"),
        (-0.0, 3, "0"),
        (1e-5, 3, "1e-5"),
        (0.0001, 3, "0.0001"),
        (None, 3, "–"),
        (float("nan"), 3, "–"),
        (float("-inf"), 3, "–"),
    ],
)
def test_a_bare_number_has_its_digits_and_no_exponent_below_ten_million(value, digits, said) -> None:
    assert number(value, digits) == said


@pytest.mark.parametrize(
    ("reading", "scale", "said"),
    [
        (Quantity(0.98765432, 0.0099), 1.0, "0.9877(99)"),
        (Quantity(0.98765432, 0.1), 1.0, "0.99(10)"),
        (Quantity(0.98765432, 0.1), 1e-3, "0.00099(10)"),
        (Quantity(5.5, 0.31), -1.0, "-5.50(31)"),
        (Quantity(21.0, 1.0), 1.0, "21.0(10)"),
        (Quantity(21.0, 9.9), 1.0, "21.0(99)"),
        (Quantity(21.0, 10.0), 1.0, "21 ± 10"),
        (Quantity(1.5, 1e-11), 1.0, "1.500000000000(10)"),
        (Quantity(1.5, 9e-12), 1.0, str(Quantity(1.5, 9e-12))),
        (Quantity(1.23456789, float("inf")), 1.0, "1.23457"),
        (Quantity(float("nan"), 0.1), 1.0, "–"),
    ],
)
def test_brackets_hold_two_digits_of_the_uncertainty(reading, scale, said) -> None:
    assert wording.concise_text(reading, scale) == said


def test_a_hover_says_how_a_number_was_read_and_what_its_uncertainty_is() -> None:
    read = str(wording.reading_tooltip("COR", Quantity(0.9, 0.1, "a line"), "the restitution", std="± is small."))
    assert [part in read for part in ("COR", "the restitution", "Read from: a line", "± is small.")] == 4 * [True]
    for bare in (Quantity(0.9, 0.0), Quantity(0.9, float("inf"))):
        assert "±" not in wording.reading_tooltip("COR", bare) and "Read from" not in wording.reading_tooltip(
            "COR", bare
        )
    assert "± is the standard uncertainty." in wording.reading_tooltip("COR", Quantity(0.9, 0.1))
    assert "No shot yet." in wording.reading_tooltip("COR", None)
    assert "No shot yet." not in wording.reading_tooltip("COR", NotSeen("too short"))


def test_times_and_sizes_on_a_disk() -> None:
    assert [wording.duration(s) for s in (-3.0, 59.99, 60.0, 3725.0)] == ["00:00", "00:59", "01:00", "62:05"]
    sizes = (999, 1000, 1_499_999, 412e9, 999.4e9, 1e12, 2.25e15)
    said = ["999 B", "1 kB", "1 MB", "412 GB", "999 GB", "1.0 TB", "2250.0 TB"]
    assert [wording.size_words(size) for size in sizes] == said


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (1e-15, "0.001 pm"),
        (0.99951e-9, "1 nm"),
        (0.9994e-9, "999 pm"),
        (-2.5e-5, "-25 µm"),
        (0.0, "0 m"),
        (4e9, "4000 Mm"),
    ],
)
def test_a_prefix_leaves_a_number_from_one_to_a_thousand(size, said) -> None:
    assert wording.with_prefix(size, "m") == said


def test_typed_numbers_have_one_decimal_sign() -> None:
    assert wording.typed_number(" −3,5 ") == -3.5 and wording.typed_number("1e-3") == 1e-3
    for text in ("1.000,5", "1,000,000", "1.2.3"):
        with pytest.raises(ValueError, match="ambiguous"):
            wording.typed_number(text)
    for text in ("", "1_000", "inf", "nan", "five"):
        with pytest.raises(ValueError, match="is not a number"):
            wording.typed_number(text)
    assert wording.typed_numbers("1, 2;3,5  4e2,") == (1.0, 2.0, 3.5, 400.0)
    assert wording.typed_numbers(" ; ") == ()


def test_every_flag_has_words_and_stands_in_the_page_of_formats():
    page = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    assert [flag for flag in FLAGS if f"`{flag}`" not in page] == []


def test_a_long_name_keeps_its_two_ends():
    name = "collision-of-2026-03-01-shot-0123"
    assert wording.short_name(name) == "collision-o…01-shot-0123"
    assert wording.short_name(name[: wording.LONGEST_NAME]) == name[: wording.LONGEST_NAME]


def test_a_sentence_of_the_diagnosis_is_put_as_the_screen_puts_numbers(german):
    told = "stiffness below 9e+01 N/m³; friction below 3e-08 N; 0.0001; (2.0 ± 0.1)e-4; file shot-1.csv"
    assert wording.localised_text(told) == (
        "stiffness below 90 N/m³; friction below 3e-8 N; 0,0001; (2,0 ± 0,1)e-4; file shot-1.csv"
    )
    assert number(-0.0) == "0"


def test_a_sentence_has_peoples_names_with_a_capital_and_a_true_arrow():
    said = wording.localised_text("The drive has coulomb friction and stribeck friction. Force error 9.16 -> 1.01 N.")
    assert said == "The drive has Coulomb friction and Stribeck friction. Force error 9.16 → 1.01 N."


def test_a_row_states_a_number_as_the_sentence_above_it_does():
    for value in (0.00100000002, 0.9999999e-3, 2.5e-5, 12.0, 3e5):
        q = Quantity(value, 1.3e-4 * value)
        assert words.quantity("coefficient_n_s2_per_m2", q) in wording.parameter_words("coefficient_n_s2_per_m2", q)


def test_a_learned_law_is_named_in_the_list_and_its_numbers_have_units():
    shot = synthetic.shot(count=9000)
    law = synthetic.learned_law()
    sizes = {name: q for name, (q, _) in law.parameters.items()}
    learned = replace(synthetic.diagnosis(shot), verdict=Verdict.LAW_LEARNED, effects=(), laws=(law,))
    found = verdict_of(learned, (1,)).found
    assert model_texts.verdict_words(learned.verdict, found) == "a force as a function of place, exponential"
    assert model_texts.verdict_words(learned.verdict, ()) == "law learned"
    both = map(wording.unbroken, ("a (-4.0000 ± 0.0010)e-3 N", "b (5.0000 ± 0.0010)e-4 m"))
    assert wording.effect_numbers(law.effect, sizes) == ", ".join(both)


def test_a_partly_explained_set_never_has_a_rest_that_is_nothing():
    remains = "a significant residual remains: 12 nm rms"
    partly = replace(synthetic.diagnosis(synthetic.shot(count=9000)), verdict=Verdict.PARTLY_EXPLAINED, effects=())
    for remainder, said in ((None, "it failed a test"), (Remainder(12e-9, 1e-10, ()), remains)):
        sentence = words.sentence(replace(partly, remainder=remainder))
        assert said in sentence and "remains: residual consistent with noise" not in sentence


@pytest.mark.parametrize(("fall", "said"), [(0.0038, "Residual reduced to 0.38 %."), (0.96, "96 %"), (0.997, "")])
def test_no_sentence_says_that_a_residual_is_reduced_to_all_of_it(fall, said):
    found = synthetic.diagnosis(synthetic.shot(count=9000))
    after = replace(found.error_after, displacement_rms_m=fall * found.error_before.displacement_rms_m)
    sentence = words.sentence(replace(found, error_after=after))
    assert said in sentence and "100 %" not in sentence and "1e+02" not in sentence
    assert ("reduced" in sentence) == bool(said)
