"""Damages files at random: bits, bytes, pieces, and the values inside JSON and TOML."""

import copy
import json
import random
from typing import Any

NASTY: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, -(10**400), 1e308, -1e308, 5e-324, 0.5, float("nan"),
    float("inf"), -float("inf"), "", "a", "x" * 10_000, "../../etc/passwd", "/etc/passwd", "\x00", "\u2028", "\ud800",
    [], {}, [[]], [None] * 1000, {"a": {"b": {}}}, "reference", "measurement", "ri16_le", "rf64_be", "1e400",
)  # fmt: skip


def spoilt_bytes(data: bytes, random_: random.Random) -> bytes:
    """Return ``data`` with a few bytes changed, cut, repeated, or something put in."""
    spoilt = bytearray(data)
    for _ in range(random_.randint(1, 4)):
        at = random_.randrange(len(spoilt) + 1)
        length = random_.choice((1, 1, 2, 8, 64, 1024))
        kind = random_.randrange(5)
        if kind == 0 and spoilt:
            spoilt[at % len(spoilt)] ^= 1 << random_.randrange(8)
        elif kind == 1:
            spoilt[at:at] = random_.randbytes(length)
        elif kind == 2:
            del spoilt[at : at + length]
        elif kind == 3:
            spoilt[at:at] = spoilt[at : at + length] * random_.choice((1, 2, 200))
        else:
            del spoilt[at:]
    return bytes(spoilt)


def spoilt_json(value: Any, random_: random.Random) -> bytes:
    """Return JSON in which one to three places, anywhere, hold something nasty, or whose text is spoilt."""
    if random_.random() < 0.25:
        return spoilt_bytes(json.dumps(value).encode(), random_)
    whole = json.loads(json.dumps(value))
    for _ in range(random_.randint(1, 3)):
        places = list(_places(whole))
        if not places:
            break
        inside, key = random_.choice(places)
        kind = random_.randrange(4)
        nasty = copy.deepcopy(random_.choice(NASTY))
        if kind == 0:
            del inside[key]
        elif kind == 1 and isinstance(inside, dict):
            inside[random_.choice(("core:dataset", "extra", "role", "core:sample_start", ""))] = nasty
        else:
            inside[key] = nasty
    if random_.random() < 0.02:
        return b'{"global":' * 50_000
    return json.dumps(whole).encode("utf-8", "surrogatepass")


def _places(value: Any) -> Any:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(items)[:50]:
        yield value, key
        yield from _places(inner)
