"""Sums of 16-bit products: exact to the last bit, by the processor's own instruction and without it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from analysis.signal.intrinsics import TOGETHER, WIDTH, has_multiply_add, make_four_dots


def _compiled(native: bool):
    four_dots = make_four_dots(native)

    @njit
    def run(samples, start, stride, taps, out):
        for place in range(0, out.shape[1], TOGETHER):
            four_dots(samples, start + place * stride, stride, taps, out, place)

    return run


FORMS = {"plain": _compiled(False)} | ({"native": _compiled(True)} if has_multiply_add() else {})


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=40, deadline=None)
@given(
    start=st.integers(0, 9),
    stride=st.integers(1, 70),
    vectors=st.integers(1, 9),
    fours=st.integers(1, 5),
    seed=st.integers(0, 99),
)
def test_every_sum_is_that_of_the_products(form: str, start: int, stride: int, vectors: int, fours: int, seed: int):
    random = np.random.default_rng(seed)
    length, outputs = vectors * WIDTH, fours * TOGETHER
    samples = random.integers(-32768, 32768, start + (outputs - 1) * stride + length).astype(np.int16)
    taps = random.integers(-500, 501, (2, length)).astype(np.int16)
    out = np.empty((2, outputs), np.int32)
    FORMS[form](samples, start, stride, taps, out)
    wide = samples.astype(np.int64)
    exact = [[np.sum(wide[start + j * stride :][:length] * row) for j in range(outputs)] for row in taps]
    assert np.array_equal(out, exact)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("sample", "tap"), [(-32768, -2047), (32767, 2047), (-32768, 2047)])
def test_the_largest_allowed_sum_is_exact(form: str, sample: int, tap: int):
    taps = np.full((2, 2 * WIDTH), tap, np.int16)
    samples = np.full(2 * WIDTH + TOGETHER, sample, np.int16)
    out = np.empty((2, TOGETHER), np.int32)
    FORMS[form](samples, 0, 1, taps, out)
    assert np.all(out == 2 * WIDTH * sample * tap)
