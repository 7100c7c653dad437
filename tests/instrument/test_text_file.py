"""Reading small text files: every content is answered quickly, in one line, with little memory."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from instrument.files.foreign_reading import foreign_channels
from instrument.files.law_file import read_law
from instrument.files.recording_error import FileNotReached, RecordingError
from instrument.files.text_file import LARGEST_JSON_BYTES, MAX_VALUES, read_json, read_toml

SPOILT_JSON = {
    "Infinity": b'{"a": Infinity}',
    "beyond a float": b'{"a": 1e999}',
    "thousands of digits": b'{"a": ' + b"9" * 5000 + b"}",
    "deep": b'{"a":' * 100_000,
    "deep list": b'{"a": ' + b"[" * 200_000,
    "a key twice": b'{"a": 1, "a": 2}',
    "a key twice inside": b'{"a": {"b": 1, "b": 1}}',
    "a list": b"[]",
    "empty": b"",
    "not text": b"\xff\xfe\x00",
    "millions of values": b'{"a": [' + b"{}," * (MAX_VALUES + 1) + b"{}]}",
    "large": b'{"a": "' + b"x" * LARGEST_JSON_BYTES + b'"}',
}
SPOILT_TOML = {
    "400 digits": b"a = " + b"9" * 5000,
    "deep": b"a = " + b"[" * 200_000,
    "a name of a hundred thousand parts": b".".join([b"a"] * 100_000) + b" = 1",
    "the same in an inline table": b"a = { " + b".".join([b"a"] * 100_000) + b" = 1 }",
    "a key twice": b"a = 1\na = 2",
    "a table twice": b"[a]\n[a]\n",
    "not text": b"\xff\xfe\x00",
    "large": b"a = '" + b"x" * 2**20 + b"'",
}


@pytest.mark.parametrize("kind", SPOILT_JSON)
def test_spoilt_json(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "spoilt.json"
    path.write_bytes(SPOILT_JSON[kind])
    with pytest.raises(RecordingError, match=r"spoilt\.json: ") as caught:
        read_json(path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 700


@pytest.mark.parametrize("kind", SPOILT_TOML)
def test_spoilt_toml(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "spoilt.toml"
    path.write_bytes(SPOILT_TOML[kind])
    with pytest.raises(RecordingError, match=r"spoilt\.toml: ") as caught:
        read_toml(path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 700


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names on this system")
def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "endless").symlink_to("/dev/zero")
    for name in ("pipe", "endless", "."):
        with pytest.raises(RecordingError):
            read_json(tmp_path / name)
    with pytest.raises(FileNotReached):
        read_toml(tmp_path / "none")


def test_what_is_sound_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"a": [1, 2.5, {"b": null}], "note": "a. b, c [d] {e}"}')
    (tmp_path / "a.toml").write_text('a = [1, 2.5]\nnote = "v 1.2.3.4, [x]"\n[b.c]\nd = inf\n')
    assert read_json(tmp_path / "a.json") == {"a": [1, 2.5, {"b": None}], "note": "a. b, c [d] {e}"}
    assert read_toml(tmp_path / "a.toml") == {"a": [1, 2.5], "note": "v 1.2.3.4, [x]", "b": {"c": {"d": float("inf")}}}


@pytest.mark.parametrize(
    ("name", "read", "largest_bytes", "said"),
    [
        ("a.json", read_json, 16 * 2**20, "larger than 16 MiB"),
        ("a.toml", read_toml, 2**20, "larger than 1 MiB"),
        ("a.toml", read_law, 2**20, "larger than 1 MiB"),
        ("a.csv", foreign_channels, 2 * 2**30, "larger than 2048 MiB"),
        ("a.wav", foreign_channels, 4 * 2**30, "larger than 4 GiB"),
    ],
)
def test_a_file_is_read_up_to_a_size_and_refused_unread_beyond(
    name: str, read: Callable[[Path], object], largest_bytes: int, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if largest_bytes < 2**28:  # one of more is only looked at from too large on
        path.write_bytes(b"\n" * largest_bytes)
        try:
            read(path)
        except RecordingError as error:
            assert "larger" not in str(error)
    path.write_bytes(b"\n")
    os.truncate(path, largest_bytes + 1)
    with pytest.raises(RecordingError, match=said):
        read(path)


def test_a_name_has_two_hundred_parts_and_a_file_four_hundred_thousand_values(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    for dots, read in ((200, True), (201, False)):
        path.write_text(".".join("a" * (dots + 1)) + " = 1\n")
        if read:
            inner: object = read_toml(path)
            for _ in range(dots + 1):
                assert isinstance(inner, dict)
                (inner,) = inner.values()
            assert inner == 1
        else:
            with pytest.raises(RecordingError, match="a name of more than 200 parts"):
                read_toml(path)
    many = tmp_path / "a.json"
    for marks, read in ((400_000, True), (400_001, False)):
        many.write_text('{"a": [' + "1," * (marks - 2) + "1]}")
        if read:
            assert len(read_json(many)["a"]) == marks - 1
        else:
            with pytest.raises(RecordingError, match="more than 400000 values"):
                read_json(many)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"a": 1, "b": 2, "b": 3}', "not JSON (the key 'b' appears twice)"),
        ('{"a": 1\n, "b"}', "not JSON (Expecting ':' delimiter, line 2)"),
        ('{"a": NaN}', "not JSON (NaN is not a number in JSON)"),
        ('{"a": -1e999}', "not JSON (-1e999 is beyond every number)"),
        ("[" * 100_000, "not JSON that can be read (nested too deeply)"),
        ("[1]", "a list where an object is wanted"),
        ("\xff", "not UTF-8 text (byte 0)"),
    ],
)
def test_what_is_wrong_with_a_text_is_said_with_its_place(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(RecordingError) as refusal:
        read_json(path)
    assert str(refusal.value) == f"{path}: {why}"


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b'\xef\xbb\xbf{"a": "\xc2\xb5"}')
    assert read_json(tmp_path / "a.json") == {"a": "µ"}
