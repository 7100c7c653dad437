"""The parts of kernels as plain Python, which a test can call one at a time."""

import os
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects.kernel import STATES
from analysis.collision.solver import (
    crossings,
    exponentials,
    march,
    matrices,
    mechanical_effects,
    modes,
    propagator,
    rates,
    runge_kutta,
    system,
    two_bodies,
)

LINES_FOLLOWED = "LEVIMASS_LINES_FOLLOWED" in os.environ  # by make mutants, which sees no line of a compiled kernel
SOLVER = (crossings, exponentials, march, matrices, modes, propagator, rates, runge_kutta, system, two_bodies)


def made_plain(patch: pytest.MonkeyPatch, *modules: ModuleType) -> None:
    """Let the parts of these modules call each other in plain Python, on arrays cut by numpy."""
    for module in modules:
        for name, value in list(vars(module).items()):
            plain = getattr(value, "py_func", None)
            if plain is not None:
                patch.setattr(plain, "py_func", plain, raising=False)  # what Python calls of a part stays callable
                patch.setattr(module, name, plain)
        for name, instead in IN_PYTHON.items():
            if hasattr(module, name):
                patch.setattr(module, name, instead)


def solver_in_python(patch: pytest.MonkeyPatch, *more: ModuleType) -> Callable[[Any], int]:
    """Let solver, effects and ``more`` be called in plain Python.

    Returns what gives a function a number in the place of its address.
    """
    made_plain(patch, *SOLVER, *more)
    functions: list[Any] = [None]  # an address is never zero

    def numbered(function: Any) -> int:
        functions.append(function)
        return len(functions) - 1

    def within(number: int, s: Any, p: Any, first: int) -> None:
        functions[int(number)](s, p[first:], s[STATES:])

    patch.setattr(mechanical_effects, "address", numbered)
    patch.setattr(mechanical_effects, "complex_address", numbered)
    patch.setattr(rates, "call_within", within)
    return numbered


def cut(room: np.ndarray, at: int, shape: tuple[int, ...]) -> tuple[np.ndarray, int]:
    """Return a part of ``room`` and the position after it."""
    end = at + int(np.prod(shape))
    return room[at:end].reshape(shape), end


def cut_integers(room: np.ndarray, at: int, shape: tuple[int, ...]) -> tuple[Any, int]:
    """Return a part of ``room`` as integers, and the position after it."""
    array, end = cut(room, at, shape)
    return array.view(np.int64), end


def put_four(four: np.ndarray, row: np.ndarray, at: int) -> None:
    """Write four numbers to a row."""
    row[at : at + 4] = four


IN_PYTHON: dict[str, Callable[..., Any]] = {
    "cut": cut,
    "cut_integers": cut_integers,
    "by_address": lambda bundle: bundle,
    "four_zeros": lambda: np.zeros(4),
    "four_of": lambda row, at: row[at : at + 4].copy(),
    "put_four": put_four,
    "add_product": lambda total, by, four: total + by * four,
    "add_products": lambda total, by, four, also_by, other: total + (by * four + also_by * other),
}
