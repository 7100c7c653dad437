"""Kernels made of parts, bundles passed by address, and work arrays cut from one array."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from analysis.compiled.kernel_parts import by_address, cut, cut_integers, inlined, kernel, part


class Inner(NamedTuple):
    numbers: Any
    factor: float


class Outer(NamedTuple):
    inner: Inner
    places: Any


@inlined
def _scaled(value, by):  # type: ignore[no-untyped-def]
    return value * by


@part
def _fill(bundle, begin):  # type: ignore[no-untyped-def]
    numbers, places = bundle.inner.numbers, bundle.places
    for i in range(numbers.shape[0]):
        for j in range(numbers.shape[1]):
            numbers[i, j] = _scaled(begin + i * numbers.shape[1] + j, bundle.inner.factor)
        places[i] = i


@kernel
def _laid(room, rows, columns):  # type: ignore[no-untyped-def]
    numbers, at = cut(room, 1, (rows, columns))
    places, at = cut_integers(room, at, (rows,))
    _fill(by_address(Outer(Inner(numbers, 0.5), places)), 10.0)
    return at


@kernel
def _total(outer):  # type: ignore[no-untyped-def]
    bundle, total = by_address(outer), 0.0
    for i in range(bundle.places.size):
        total += bundle.inner.numbers[bundle.places[i], 0]
    return total


def test_arrays_cut_from_one_lie_one_behind_the_other() -> None:
    room = np.full(12, np.nan)
    assert _laid(room, 3, 2) == 1 + 6 + 3
    assert np.isnan(room[0]) and np.all(np.isnan(room[10:]))
    assert room[1:7].tolist() == [5.0, 5.5, 6.0, 6.5, 7.0, 7.5]
    assert room[7:10].view(np.int64).tolist() == [0, 1, 2]


def test_a_bundle_from_python_is_read_by_its_address() -> None:
    numbers = np.arange(6.0).reshape(3, 2)
    assert _total(Outer(Inner(numbers, 1.0), np.array([2, 0]))) == 4.0


def test_python_cannot_call_a_part() -> None:
    with pytest.raises(TypeError, match="_scaled is a part of kernels"):
        _scaled(1.0, 2.0)
