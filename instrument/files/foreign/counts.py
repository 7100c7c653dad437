"""From stored numbers to int16 counts: 8- and 16-bit ones as they are, wider ones over the range they use."""

import numpy as np
from numpy.typing import NDArray

from instrument.files.foreign.contents import Column

_TOP = 32000  # counts of the largest deviation: short of the rail, which means clipped
_RAIL = 32767
_PILED_SHARE = 1e-3  # of the samples at the extreme ...
_PILED_UP = 4.0  # ... and so many times those one level below: no beat spends its time like that unless it is cut off


class NotFinite(ValueError):
    """A sample that is no number; ``args[0]`` is its index."""


def to_counts(values: Column) -> tuple[NDArray[np.int16], float, float]:
    """Return (counts, unit_per_count, offset) with value = counts * unit_per_count + offset; shape (n,) as given.

    Wider numbers are rounded to at most 1/64000 of the range they span, 16 bits: below the noise of any digitizer of
    12 bits.  Where they pile up at an extreme as a clipped signal does, that extreme becomes the rail of the counts.
    Raises NotFinite.
    """
    kind = values.dtype
    if kind == np.int16 or kind == np.int8:
        return np.ascontiguousarray(values, dtype=np.int16), 1.0, 0.0
    if kind == np.uint8 or kind == np.uint16:
        middle = 128 if kind == np.uint8 else 32768
        return (values.astype(np.int32) - middle).astype(np.int16), 1.0, float(middle)
    if values.size == 0:
        return np.empty(0, np.int16), 1.0, 0.0
    low, high = float(values.min()), float(values.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        raise NotFinite(int(np.argmin(np.isfinite(values))))
    offset, half = 0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low
    if half <= 0.0:
        return np.zeros(values.size, np.int16), 1.0, offset
    unit = half / (_RAIL if _piled_up(values, high, -1) or _piled_up(values, low, 1) else _TOP)
    counts = np.empty(values.size, np.int16)
    step = 2**20
    for start in range(0, values.size, step):  # block by block: no second copy of a long shot in floats
        block = values[start : start + step].astype(np.float64)
        counts[start : start + step] = np.clip(np.rint((block - offset) / unit), -_RAIL, _RAIL)
    return counts, unit, offset


def _piled_up(values: Column, extreme: float, inward: int) -> bool:
    at = int(np.count_nonzero(values == extreme))
    if at <= _PILED_SHARE * values.size or at < 8:
        return False
    rest = values[values != extreme]
    if rest.size == 0:
        return False
    following = rest.max() if inward < 0 else rest.min()
    return bool(at > _PILED_UP * np.count_nonzero(rest == following))
