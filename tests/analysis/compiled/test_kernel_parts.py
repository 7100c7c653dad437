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


@kernel
def _deep(room, shape):  # type: ignore[no-untyped-def]
    deep, at = cut(room, 2, shape)
    line, at = cut_integers(room, at, (3,))
    last, at = cut(room, at, (1, 1))
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                deep[i, j, k] = 100.0 * i + 10.0 * j + k
    line[2], last[0, 0] = -7, 0.5
    return at, deep.shape, deep.strides, deep.size, line.size


def test_a_cut_array_is_laid_out_as_numpy_lays_it_out() -> None:
    room = np.full(40, np.nan)
    at, shape, strides, size, line = _deep(room, (2, 3, 4))
    known = np.add.outer(np.add.outer(100.0 * np.arange(2), 10.0 * np.arange(3)), np.arange(4.0))
    assert (at, shape, strides, size, line) == (2 + 24 + 3 + 1, known.shape, known.strides, 24, 3)
    assert np.array_equal(room[2:26].reshape(2, 3, 4), known)
    assert room[28:29].view(np.int64).tolist() == [-7] and room[29] == 0.5 and np.isnan(room[[0, 1, 30]]).all()


@kernel
def _misspelt(outer):  # type: ignore[no-untyped-def]
    return by_address(outer).inner.number


def test_a_field_that_a_bundle_lacks_is_refused_when_it_is_compiled() -> None:
    with pytest.raises(Exception, match="number"):
        _misspelt(Outer(Inner(np.zeros((1, 1)), 1.0), np.array([0])))
