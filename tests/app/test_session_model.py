"""The table of shots: its order, filter and groups, and what every cell shows, edits and says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import Qt

from analysis.collision.effects import effects_named
from analysis.diagnosis import Verdict
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.shot import AnalysisSettings
from analysis.uncertainty import combined_uncertainties
from app.session.entry import Entry
from app.session.verdict_basis import VerdictBasis
from app.window.panels.session_model import FLAGS, NAME, NOTE, VERDICT, SessionModel, TableOrder, ordered, place_of
from app.words.wording import concise_text
from tests.app import synthetic

DISPLAY, EDIT, FONT, HOVER = (
    Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole, Qt.ItemDataRole.FontRole, Qt.ItemDataRole.ToolTipRole,
)  # fmt: skip


def _entry(number: int, name: str = "a-1", **more: object) -> Entry:
    return Entry(number, name, Path(f"/shots/{name}"), AnalysisSettings(), **more)  # type: ignore[arg-type]


@given(st.lists(st.one_of(st.none(), st.just(float("nan")), st.integers(-3, 3).map(float)), max_size=12), st.booleans())
def test_values_are_in_order_either_way_equal_ones_as_taken_and_missing_ones_last(values, falling) -> None:
    entries = [_entry(n) for n in range(len(values))]
    rows = ordered(entries, TableOrder(column=3, falling=falling), lambda entry: values[entry.number], lambda entry: "")
    there = [n for n, value in enumerate(values) if value is not None and not np.isnan(value)]
    missing = [n for n in range(len(values)) if n not in there]
    # a stable order: what is equal stays in the order taken, falling as well
    expected = sorted(there, key=lambda n: -values[n] if falling else values[n])
    assert [row.number for row in rows] == expected + missing  # type: ignore[union-attr]


def test_texts_are_in_order_whatever_their_capitals_and_all_words_must_occur() -> None:
    entries = [_entry(1, "beta"), _entry(2, "Alpha"), _entry(3, ""), _entry(4, "alp")]
    rows = ordered(entries, TableOrder(column=2), lambda entry: entry.name, lambda entry: entry.name)
    assert [row.number for row in rows] == [4, 2, 1, 3]
    found = ordered(entries, TableOrder(words="ALP ha"), None, lambda entry: entry.name)
    assert [row.number for row in found] == [2]
    assert ordered(entries, TableOrder(words="  "), None, lambda entry: entry.name) == tuple(entries)


@pytest.mark.parametrize(
    ("group", "headings"),
    [
        ("day", ["2026-05-01   (2)", "no date   (1)", "2026-05-02   (1)"]),
        ("series", ["north   (2)", "7   (1)", "south   (1)"]),
        ("verdict", ["not diagnosed   (3)", "adequate   (1)"]),
        ("model", ["paper   (3)", "contact   (1)"]),
        ("nothing", []),
    ],
)
def test_groups_come_in_the_order_of_their_first_shots_with_their_numbers(group: str, headings: list[str]) -> None:
    def dated(day: str | None) -> object:
        return replace(synthetic.bare_shot("x"), started_at=day)

    adequate = VerdictBasis((), (), (3,), Verdict.ADEQUATE)
    entries = [
        _entry(1, "north-001", shot=dated("2026-05-01T09:00:00Z")),
        _entry(2, "7", shot=dated(None)),
        _entry(3, "south_ 2", shot=dated("2026-05-02T09:00:00Z"), verdict_of=adequate),
        replace(_entry(4, "north-2", shot=dated("2026-05-01T10:00:00Z")), settings=AnalysisSettings(model="contact")),
    ]
    rows = ordered(entries, TableOrder(group=group), None, lambda entry: "")
    assert [row for row in rows if isinstance(row, str)] == headings
    assert sorted(row.number for row in rows if isinstance(row, Entry)) == [1, 2, 3, 4]


@pytest.fixture(scope="module")
def shot():
    return replace(synthetic.shot("north-1"), flags=("vibration", "clipped"), started_at="2026-05-01T09:08:07Z")


@pytest.fixture
def model(shot, qapp):
    model = SessionModel()
    found = VerdictBasis((), effects_named(("tilt", "adhesion")), (1,), Verdict.EFFECT_FOUND)
    model.show_entries(
        (
            _entry(1, "north-1", shot=shot, verdict_of=found, note="first"),
            replace(_entry(2, "later", copy_of=1), path=None),
            _entry(3, "bad", shot=replace(synthetic.bare_shot("bad"), problem="no beat")),
        ),
        struck=(1,),
    )
    return model


def _shown(model: SessionModel, row: int, column: int, role: object = DISPLAY) -> object:
    return model.data(model.index(row, column), role)  # type: ignore[arg-type]


def test_a_row_shows_number_time_name_verdict_flags_and_note(model) -> None:
    places = [place_of(head) for head in ("#", "time", "name", "verdict", "flags", "note")]
    assert [[_shown(model, row, place) for place in places] for row in range(3)] == [
        ["1", "09:08:07", "north-1", "tilt + 1", "clipped + 1", "first"],
        ["2 (1)", "–", "later", "waiting for analysis", "", ""],
        ["3", "–", "bad", "no beat", "", ""],
    ]
    assert [model.headerData(place, Qt.Orientation.Horizontal) for place in places][2:4] == ["name", "verdict"]
    assert model.headerData(0, Qt.Orientation.Vertical) is None
    assert (model.rowCount(), model.columnCount()) == (3, len(model.columns))


def test_numbers_stand_at_the_right_with_their_combined_uncertainty_and_say_what_it_is(model, shot) -> None:
    for place, column in enumerate(model.columns):
        side = _shown(model, 0, place, Qt.ItemDataRole.TextAlignmentRole)
        head = model.headerData(place, Qt.Orientation.Horizontal, Qt.ItemDataRole.TextAlignmentRole)
        assert bool(head & Qt.AlignmentFlag.AlignRight) == (column.number is not None) == (side is not None)
        if column.number is None:
            continue
        reading, std = column.number.find(shot), combined_uncertainties(shot).get(column.number.key)
        if isinstance(reading, Quantity) and std is not None:
            reading = replace(reading, std=std)
        assert _shown(model, 0, place) == concise_text(reading, column.number.scale) == _shown(model, 0, place, EDIT)
        said = str(_shown(model, 0, place, HOVER))
        assert ("combined" in said) == (isinstance(reading, Quantity) and std is not None), column.head
        assert ("Not measured" in said) == isinstance(reading, NotSeen)
        assert _shown(model, 1, place) == "–" and "No shot yet" in str(_shown(model, 1, place, HOVER))


def test_a_verdict_about_another_model_is_struck_out_and_says_so(model) -> None:
    assert _shown(model, 0, VERDICT, FONT).strikeOut()  # type: ignore[union-attr]
    assert _shown(model, 0, VERDICT, EDIT) == "a tilt of the guideway + adhesion at release (of another model)"
    assert "run Diagnose again" in str(_shown(model, 0, VERDICT, HOVER))
    assert _shown(model, 2, VERDICT, FONT) is None is _shown(model, 0, NAME, FONT)
    assert _shown(model, 2, VERDICT, EDIT) == "no beat" and "diagnose" not in str(_shown(model, 2, VERDICT, HOVER))


def test_hovers_say_where_a_shot_is_what_it_copies_and_what_its_flags_mean(model) -> None:
    assert "/shots/north-1" in str(_shown(model, 0, NAME, HOVER)) and "model paper" in str(
        _shown(model, 0, NAME, HOVER)
    )
    copied = str(_shown(model, 1, NAME, HOVER))
    assert "Shot 1 with other settings." in copied and "not saved" in copied
    flags = str(_shown(model, 0, FLAGS, HOVER))
    assert flags.index("cut off") < flags.index("vibrates")  # what casts doubt comes first
    assert _shown(model, 0, FLAGS, EDIT) == "clipped, vibration"


def test_only_notes_are_edited_and_only_a_change_is_told(model, qtbot) -> None:
    editable = Qt.ItemFlag.ItemIsEditable
    for column in range(model.columnCount()):
        assert bool(model.flags(model.index(0, column)) & editable) == (column == NOTE)
    with qtbot.waitSignal(model.note_edited) as told:
        assert model.setData(model.index(0, NOTE), "second")
    assert told.args == [1, "second"]
    with qtbot.assertNotEmitted(model.note_edited):
        assert model.setData(model.index(0, NOTE), "first")
        assert not model.setData(model.index(0, NAME), "x")
        assert not model.setData(model.index(0, NOTE), "x", DISPLAY)


def test_a_heading_is_bold_stands_in_the_first_column_and_cannot_be_chosen(model) -> None:
    model.arrange(TableOrder(group="model"))
    assert model.identities == ["paper   (3)", 1, 2, 3] and model.entry_at(0) is None and model.entry_at(9) is None
    assert [_shown(model, 0, column) for column in (0, 1, 5)] == ["paper   (3)", "", ""]
    assert _shown(model, 0, 0, FONT).bold() and _shown(model, 0, 3, FONT).bold()  # type: ignore[union-attr]
    assert _shown(model, 0, 0, HOVER) is None
    assert model.flags(model.index(0, NOTE)) == Qt.ItemFlag.ItemIsEnabled
    assert model.entry_at(1) is model.entries[0]


def test_what_is_searched_is_names_verdicts_notes_and_flags_in_words(model) -> None:
    for words, numbers in (
        ("first", [1]), ("cut off", [1]), ("clipped", [1]), ("bad", [3]), ("waiting", [2]), ("nowhere", []),
    ):  # fmt: skip
        model.arrange(TableOrder(words=words))
        assert model.identities == numbers, words


def test_rows_that_only_changed_or_came_last_keep_the_others_where_they_are(model, qtbot) -> None:
    with qtbot.assertNotEmitted(model.modelReset), qtbot.waitSignal(model.dataChanged):
        model.show_entries((*model.entries[:2], replace(model.entries[2], note="now")))
    assert _shown(model, 2, NOTE) == "now" and _shown(model, 0, VERDICT, FONT) is None  # struck no longer
    with qtbot.assertNotEmitted(model.modelReset), qtbot.waitSignal(model.rowsInserted) as told:
        model.show_entries((*model.entries, _entry(4), _entry(5)))
    assert told.args[1:] == [3, 4] and model.identities == [1, 2, 3, 4, 5]
    with qtbot.waitSignal(model.modelReset):
        model.show_entries(model.entries[1:])
    column = next(n for n, one in enumerate(model.columns) if one.number is not None)
    model.show_entries((_entry(1), *model.entries))
    model.arrange(TableOrder(column=0, falling=True))
    assert model.identities == [5, 4, 3, 2, 1] and column > 0
