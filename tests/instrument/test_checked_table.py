"""Values of a foreign file: each of its type and within its limits, or refused with file, place and key."""

import math
import tomllib
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from instrument.files.atomic_file import write_json_atomic, write_toml_atomic
from instrument.files.recording_error import RecordingError
from instrument.files.text_file import CheckedTable

PATH = Path("a.toml")


def _of(**values: object) -> CheckedTable:
    return CheckedTable(PATH, values, "rig")


def _refused(line: str) -> Any:
    return pytest.raises(RecordingError, match=rf"^a\.toml: rig\.k{line}$")


@pytest.mark.parametrize("value", [1, 1.0, 2.5, 5, 5.0])
def test_a_number_within_its_limits_is_a_float(value: float) -> None:
    found = _of(k=value).number("k", 1, 5)
    assert found == value and isinstance(found, float) and _of(k=value).required("k", 1, 5) == value


@pytest.mark.parametrize(
    ("value", "line"),
    [
        (0.999, ": 0.999 is not from 1 to 5"),
        (5.001, ": 5.001 is not from 1 to 5"),
        (math.nan, ": nan is not from 1 to 5"),
        (10**400, ": a huge whole number is not from 1 to 5"),
        (True, ": True is not a number"),
        ("2", ": '2' is not a number"),
        ([2], ": a list is not a number"),
    ],
)
def test_what_is_no_such_number_is_refused(value: object, line: str) -> None:
    with _refused(line):
        _of(k=value).number("k", 1, 5)


def test_what_is_missing_has_its_default_or_is_refused_where_it_is_required() -> None:
    nothing = _of()
    assert nothing.number("k", 1, 5) is None
    assert [nothing.whole("k", 1, 5), nothing.text("k"), nothing.object("k"), nothing.objects("k")] == [None] * 4
    assert nothing.names("k") == ()
    for ask in (lambda: nothing.required("k", 1, 5), lambda: nothing.required_object("k")):
        with _refused(": missing"):
            ask()
    with pytest.raises(RecordingError, match=r"^a\.toml: k: missing$"):
        CheckedTable(PATH, {}).required("k", 0, 1)


@pytest.mark.parametrize(
    ("value", "found"), [(1, 1), (5, 5), (4.0, 4), (2.0**53, None), (4.5, None), (True, None), (0, None), (6, None)]
)
def test_a_whole_number_may_be_written_as_a_float(value: float, found: int | None) -> None:
    if found is not None:
        assert _of(k=value).whole("k", 1, 5) == found and type(_of(k=value).whole("k", 1, 5)) is int
    else:
        with _refused(r": .* is not (a whole number|from 1 to 5)"):
            _of(k=value).whole("k", 1, 5)


def test_texts_objects_and_lists_are_what_they_should_be_and_their_place_is_told() -> None:
    assert _of(k="abc").text("k", 3) == "abc"
    with _refused(": longer than 3 characters"):
        _of(k="abcd").text("k", 3)
    with _refused(": 3 is not text"):
        _of(k=3).text("k")
    inner = _of(k={"a": 1, "b": 2}).object("k")
    assert inner is not None and inner.place == "rig.k" and inner.number("a", 0, 2) == 1.0
    assert inner.unread() == {"b": 2}
    listed = _of(k=[{"a": 1}, {"a": 9}]).objects("k")
    assert listed is not None and [one.place for one in listed] == ["rig.k[0]", "rig.k[1]"]
    with _refused(r"\[1\]\.a: 9 is not from 0 to 2"):
        listed[1].number("a", 0, 2)
    with _refused(r"\[1\]: 3 is not an object"):
        _of(k=[{}, 3]).objects("k")
    for value, line in (({}, "an object is not a list"), (3, "3 is not a list")):
        with _refused(f": {line}"):
            _of(k=value).objects("k")
    with _refused(": a list is not an object"):
        _of(k=[]).object("k")
    assert _of(k=["a", "b"]).names("k") == ("a", "b") and _of(k=[1, 2]).names("k", int) == (1, 2)
    for value, kind, what in ((["a", 1], str, "names"), ([1, True], int, "numbers"), ("ab", str, "names")):
        with _refused(f": not a list of {what}"):
            _of(k=value).names("k", kind)
    top = CheckedTable(PATH, {"k": [{}]})
    assert [one.place for one in top.objects("k") or []] == ["k[0]"]


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Inner:
    size: float


@dataclass(frozen=True)
class Whole:
    """A dataclass with a field of every type that is read."""

    real: float
    number: int = 3
    word: str = "usual"
    flag: bool = False
    colour: Colour = Colour.RED
    maybe: float | None = None
    names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = (1,)
    inner: Inner | None = None
    own: str = ""


def test_a_dataclass_is_built_of_what_is_given_and_its_defaults() -> None:
    given = {"real": 2, "number": 4.0, "word": "w", "flag": True, "colour": "blue", "maybe": 1e15, "names": ["a"]}
    table = _of(**given, numbers=[7, 8], inner={"size": 1}, other=5)
    built = table.read_dataclass(Whole, {"own": lambda of: f"{of.place}!"})
    assert built == Whole(2.0, 4, "w", True, Colour.BLUE, 1e15, ("a",), (7, 8), Inner(1.0), "rig!")
    assert table.unread() == {"other": 5}
    assert _of(real=1.5).read_dataclass(Whole) == Whole(1.5)
    for values, line in (
        ({}, r"real: missing"),
        ({"real": 1.1e15}, r"real: 1100000000000000.0 is not from -1e\+15 to 1e\+15"),
        ({"real": 1, "number": 0}, r"number: 0 is not from 1 to 2147483648"),
        ({"real": 1, "flag": 1}, r"flag: 1 is neither true nor false"),
        ({"real": 1, "colour": "green"}, r"colour: 'green' is none of red, blue"),
        ({"real": 1, "word": 1}, r"word: 1 is not text"),
        ({"real": 1, "inner": {}}, r"inner.size: missing"),
        ({"real": 1, "numbers": ["a"]}, r"numbers: not a list of numbers"),
    ):
        with pytest.raises(RecordingError, match=rf"^a\.toml: rig\.{line}$"):
            _of(**values).read_dataclass(Whole)


KEYS = st.text("aZ_-09 .é\"'\\\n", max_size=6)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: (
        st.dictionaries(KEYS, inner, max_size=3) | st.lists(inner.filter(lambda value: value is not None), max_size=3)
    ),
    max_leaves=8,
)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
    return value


def _has_none_in_list(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_has_none_in_list(inner) for inner in value.values())
    return isinstance(value, list) and any("None" in repr(inner) for inner in value)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_a_table_is_read_as_it_was_written_without_what_is_none(tmp_path: Path, table: dict[str, Any]) -> None:
    if _has_none_in_list(table):
        return
    path = tmp_path / "t.toml"
    write_toml_atomic(path, table, "what this is")
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# what this is\n") and tomllib.loads(text) == _without_none(table)


def test_a_table_is_written_as_a_person_would_write_it(tmp_path: Path) -> None:
    """No header for a table that holds tables alone; an empty one has its header, as it would be lost else."""
    table = {
        "a": 1, "nothing": None, "outer": {"inner": {"x y": [1, 2.5, "c"], "deep": {"z": True}}, "gone": None},
        "empty": {}, "listed": [{"b": {"c": "d"}}],
    }  # fmt: skip
    write_toml_atomic(tmp_path / "t.toml", table)
    assert (tmp_path / "t.toml").read_text() == "\n".join(
        [
            *("a = 1", 'listed = [{b = {c = "d"}}]', "", "[outer.inner]", '"x y" = [1, 2.5, "c"]', ""),
            *("[outer.inner.deep]", "z = true", "", "[empty]", ""),
        ]
    )


def test_json_is_written_a_value_a_line_and_what_it_cannot_hold_is_refused(tmp_path: Path) -> None:
    write_json_atomic(tmp_path / "a.json", {"a": [1, {"b": None}]}, sync=True)
    assert (tmp_path / "a.json").read_text() == '{\n "a": [\n  1,\n  {\n   "b": null\n  }\n ]\n}\n'
    for value in (math.nan, math.inf, object()):
        with pytest.raises(RecordingError, match="cannot be written as JSON"):
            write_json_atomic(tmp_path / "b.json", {"a": value}, sync=False)
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
