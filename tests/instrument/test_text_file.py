"""Reading small text files: every content is answered quickly, in one line, with little memory."""

import os
from pathlib import Path

import pytest

from instrument.files.recording_error import FileNotReached, RecordingError
from instrument.files.text_file import LARGEST_JSON_BYTES, MOST_VALUES, read_json, read_toml

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
    "millions of values": b'{"a": [' + b"{}," * (MOST_VALUES + 1) + b"{}]}",
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
