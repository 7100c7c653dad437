"""Store analysed shots and diagnoses as NumPy archives, with their structure as JSON.

Reading a file executes no code: it names classes, and only the classes within Shot and Diagnosis are constructed.
"""

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, cast, get_args, get_type_hints

import numpy as np

from analysis.collision import Acts, Effect
from analysis.diagnosis import Diagnosis, effect_in_file
from analysis.drive import GAIN_ERROR, MassCheck, Repeatability
from analysis.shot import Shot
from levimass import DRIVE

_HEAD, _BODY = "head", "body"


class NotStorable(Exception):
    """A value cannot be stored, or a file cannot be read; the message says why."""


@cache
def kinds() -> dict[str, type]:
    """Return the dataclasses and enumerations within Shot and Diagnosis, by name; effects are stored by their keys."""
    found: dict[str, type] = {}
    left: list[Any] = [Shot, Diagnosis]
    while left:
        kind = left.pop()
        left += get_args(kind)
        if not isinstance(kind, type) or kind.__name__ in found or issubclass(kind, Effect):
            continue
        if is_dataclass(kind):
            # Diagnosis declares these two types only as strings
            hints = get_type_hints(kind, localns={one.__name__: one for one in (MassCheck, Repeatability)})
            left += [hints[field.name] for field in fields(kind)]
        elif not issubclass(kind, Enum):
            continue
        found[kind.__name__] = kind
    return found


def packed(head: Mapping[str, Any], value: object) -> bytes:
    """Return the bytes of a file with ``value`` and a separately readable ``head``.  Raises NotStorable."""
    body, arrays = split(value)
    out = io.BytesIO()
    texts = {name: np.frombuffer(json.dumps(text).encode(), np.uint8) for name, text in ((_HEAD, head), (_BODY, body))}
    np.savez(out, **cast(Any, texts), **cast(Any, {f"a{place}": array for place, array in enumerate(arrays)}))
    return out.getvalue()


def head_of(file: Any) -> dict[str, Any]:
    """Read only the head of a file, given as a path or a stream.  Raises NotStorable."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            head = json.loads(archive[_HEAD].tobytes())
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise NotStorable(str(error)) from None
    if not isinstance(head, dict):
        raise NotStorable("its header is not an object")
    return head


def unpacked(file: Any) -> object:
    """Read the value in a file; its arrays are read-only.  Raises NotStorable."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            body = json.loads(archive[_BODY].tobytes())
            arrays = [archive[f"a{place}"] for place in range(len(archive.files) - 2)]
            for array in arrays:
                array.flags.writeable = False
            return rebuild(body, arrays)
    except (OSError, ValueError, KeyError, IndexError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise NotStorable(str(error)) from None  # the file is damaged or of another version


def split(value: object) -> tuple[Any, list[np.ndarray]]:
    """Split a value into its JSON structure and its arrays, each array once.  Raises NotStorable."""
    arrays: list[np.ndarray] = []
    places: dict[int, int] = {}  # of the arrays in the list, by their id

    def written(value: object) -> Any:
        if isinstance(value, Effect):
            return {"effect": value.key, "base": DRIVE if value.acts is Acts.IN_DRIVE else ""}
        if isinstance(value, Enum):
            return {"kind": type(value).__name__, "value": value.value}
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, np.ndarray):
            if id(value) not in places:
                places[id(value)] = len(arrays)
                arrays.append(value)
            return {"array": places[id(value)]}
        if isinstance(value, Mapping):
            return {"map": [[key, written(one)] for key, one in value.items()]}
        if isinstance(value, tuple | list):
            return {type(value).__name__: [written(one) for one in value]}
        if is_dataclass(value) and type(value).__name__ in kinds():
            own = {field.name: written(getattr(value, field.name)) for field in fields(value)}
            return {"kind": type(value).__name__, "fields": own}
        raise NotStorable(f"a {type(value).__name__} cannot be stored")

    return written(value), arrays


def rebuild(body: Any, arrays: list[np.ndarray]) -> Any:
    """Build a value from its JSON structure and its arrays: the inverse of ``split``."""
    if not isinstance(body, dict):
        return body
    if "array" in body:
        return arrays[body["array"]]
    if "effect" in body:
        known = GAIN_ERROR if body["effect"] == GAIN_ERROR.key else None
        effect = known or effect_in_file(body["effect"], body["base"])
        if effect is None:
            raise NotStorable(f"no effect is called {body['effect'][:40]!r}")
        return effect
    if "map" in body:
        return {key: rebuild(one, arrays) for key, one in body["map"]}
    for kind in (tuple, list):
        if kind.__name__ in body:
            return kind(rebuild(one, arrays) for one in body[kind.__name__])
    kind = cast(Any, kinds()[body["kind"]])
    if "value" in body:
        return kind(body["value"])
    return kind(**{name: rebuild(one, arrays) for name, one in body["fields"].items()})
