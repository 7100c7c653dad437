"""Write files atomically: a new file is written in the same folder and then moved to the final name."""

import contextlib
import hashlib
import json
import os
import stat
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from instrument.files.recording_error import RecordingError, RecordingExists, system_message

PATIENCE_S = 2.0
_LOOK_S = 0.05


def write_json_atomic(path: Path, value: Mapping[str, Any], *, sync: bool) -> None:
    """Write a JSON file with ``write_atomic``."""
    try:
        text = json.dumps(value, indent=1, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise RecordingError(path, f"cannot be written as JSON ({error})") from None
    write_text_atomic(path, text + "\n", sync=sync)


def write_toml_atomic(path: Path, table: Mapping[str, Any], head: str = "") -> None:
    """Write a TOML file that begins with the comment ``head``, with ``write_atomic``; values of None are omitted."""
    lines = [f"# {head}"] if head else []
    write_text_atomic(path, "\n".join(lines + _toml_lines(table)) + "\n", sync=True)


def _toml_lines(table: Mapping[str, Any], name: str = "") -> list[str]:
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    values = [(key, value) for key, value in table.items() if key not in inner and value is not None]
    lines = ["", f"[{name}]"] if name and (values or not inner) else []
    lines += [f"{_toml_key(key)} = {_toml_value(value)}" for key, value in values]
    for key, value in inner.items():
        lines += _toml_lines(value, f"{name}.{_toml_key(key)}" if name else _toml_key(key))
    return lines


def _toml_key(name: str) -> str:
    return name if name.isascii() and name.replace("_", "").isalnum() else _toml_value(name)


def _toml_value(value: Any) -> str:
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_toml_key(str(k))} = {_toml_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    # strings, integers and booleans are written the same in JSON and TOML, except for one character
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_text_atomic(path: Path, text: str | Iterable[str], *, sync: bool) -> None:
    """Write text, whole or in pieces, with ``write_atomic``; characters that UTF-8 cannot encode are escaped."""
    pieces = (text,) if isinstance(text, str) else text
    write_atomic(path, (piece.encode("utf-8", errors="backslashreplace") for piece in pieces), sync=sync)


def write_atomic(path: Path, content: Iterable[bytes | memoryview], *, sync: bool) -> None:
    """Write a new file in the folder of ``path``, fsync it if ``sync``, and move it to ``path``.

    A symbolic link remains and its target is replaced.  A device or a pipe is written directly.  Raises RecordingError.
    """
    check_writable(path)
    with as_recording_error(path):
        if _is_device(path):
            path.write_bytes(b"".join(content))
            return
        path = Path(os.path.realpath(path))
        short = hashlib.sha1(os.fsencode(path.name)).hexdigest()  # a long name must not become too long
        new = path.with_name(f".{short}.{os.getpid()}-{threading.get_ident()}.new")  # unique to this thread
        try:
            with open(new, "wb") as file:
                copy_permissions(new, path)  # before the file has content to protect
                file.writelines(content)
                if sync:
                    file.flush()
                    os.fsync(file.fileno())
            replace_file(new, path)
        except BaseException:
            with contextlib.suppress(OSError):
                new.unlink()
            raise
        if sync:
            sync_folder(path.parent)


def check_writable(path: Path) -> None:
    """Raise RecordingError if ``write_atomic`` would fail; to be called before a long computation."""
    with as_recording_error(path):
        with contextlib.suppress(FileNotFoundError):
            os.lstat(path)  # raises for a name that is too long or treats a file as a folder
        if os.path.isdir(path):
            raise IsADirectoryError(0, "a folder, not a file")
        place = path if _is_device(path) else Path(os.path.realpath(path)).parent
        os.stat(place)
        if place != path and not os.path.isdir(place):
            raise NotADirectoryError(0, f"{place} is not a folder")
        if not os.access(place, os.W_OK):
            raise PermissionError(0, "no right to write there")


def _is_device(path: Path) -> bool:
    return os.path.exists(path) and not os.path.isfile(path)


@contextlib.contextmanager
def as_recording_error(path: Path) -> Iterator[None]:
    """Convert an OSError inside the with block to a RecordingError that names ``path``."""
    try:
        yield
    except FileExistsError:
        raise RecordingExists(path) from None
    except FileNotFoundError:
        raise RecordingError(path, "the folder does not exist") from None
    except OSError as error:
        raise RecordingError(path, system_message(error)) from error


def replace_file(source: Path, target: Path) -> None:
    """Move ``source`` to ``target`` with ``os.replace``, retrying for two seconds while another program has it open.

    The new file gets mode and owner of the file it replaces.  Raises an OSError that names ``target``, and then leaves
    ``source`` in place.
    """
    copy_permissions(source, target)
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            os.replace(source, target)
            return
        except PermissionError as error:
            if time.monotonic() > end or not _may_be_open_elsewhere(target):
                raise PermissionError(error.errno, _in_words(error), str(target)) from error
        time.sleep(_LOOK_S)


def copy_permissions(path: Path, like: Path) -> None:
    """Give ``path`` the mode and owner of the file ``like``, if it exists and as far as this user is permitted."""
    try:
        wanted, now = like.stat(), path.stat()
        if stat.S_ISREG(wanted.st_mode) and hasattr(os, "chown"):
            if (wanted.st_uid, wanted.st_gid) != (now.st_uid, now.st_gid):
                with contextlib.suppress(PermissionError):  # ``like`` is another user's; the new file stays this user's
                    os.chown(path, wanted.st_uid, wanted.st_gid)
            os.chmod(path, stat.S_IMODE(wanted.st_mode) & 0o777)
    except OSError:
        return


def sync_folder(folder: Path) -> None:
    """Write a folder's entries to disk, without which a file moved into it is not safe.  Raises OSError."""
    if os.name == "posix":  # Windows has no equivalent call and needs none
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _may_be_open_elsewhere(target: Path) -> bool:
    return os.name == "nt" or os.access(target.parent, os.W_OK)  # otherwise this user has no write permission


def _in_words(error: OSError) -> str:
    in_use = getattr(error, "winerror", None) in (5, 32)
    return "held by another program (a virus scanner, a synchronised folder?)" if in_use else system_message(error)
