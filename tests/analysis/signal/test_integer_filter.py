"""The filter in integers: no sum overflows or rounds, no phase is turned; image and noise are those of exact taps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import config, njit

from analysis.signal.integer_filter import TOGETHER, WIDTH, has_multiply_add, integer_taps, make_four_dots
from analysis.signal.tuning import PHASE_STEPS, Tuning, tune

IntegerTaps = tuple[np.ndarray, np.ndarray]  # taps and gains
TUNINGS = [
    tune(30e6, 1.9e6, 3.6e6, 180e3, 450e3),
    tune(30e6, 2.74e6, 2.76e6, 120e3, 200e3),
    tune(10e6, 3.2e6, 3.7e6, 150e3, 450e3),
    tune(10e6, 3.4e6, 3.4e6, 1e6, 2e6),
    tune(10e6, 0.6e6, 0.6e6, 120e3, 200e3),
    tune(30e6, 3.4e6, 3.5e6, 40e3, 100e3),
]


def _whole(tuning: Tuning, offset_counts: float = 0.0) -> tuple[IntegerTaps, np.ndarray]:
    steps = np.array([tuning.steps(f) for f in np.linspace(tuning.low_hz, tuning.high_hz, 20)])
    turns = steps / (PHASE_STEPS * tuning.decimation)
    return integer_taps(tuning.window, turns, offset_counts), turns


def _restored(whole: IntegerTaps, length: int) -> np.ndarray:
    taps, gains = whole[0], whole[1].astype(np.float64)
    return gains[:, :1] * taps[:, 0, :length] + 1j * gains[:, 1:2] * taps[:, 1, :length]


@pytest.mark.parametrize("tuning", TUNINGS)
def test_full_scale_cannot_overflow_and_the_scale_is_used(tuning: Tuning) -> None:
    (taps, _), _ = _whole(tuning)
    most = np.abs(taps.astype(np.int64)).sum(axis=2).max(axis=1)
    assert np.all(32768 * most < 2**31)
    assert np.all(most > 0.95 * 65535)
    assert not taps[:, :, tuning.length :].any()


@pytest.mark.parametrize("tuning", TUNINGS)
def test_rounding_shifts_no_phase_passes_no_image_and_adds_no_noise(tuning: Tuning) -> None:
    whole, turns = _whole(tuning)
    taps = _restored(whole, tuning.length)
    position = np.arange(tuning.length) - tuning.delay_samples
    exact = tuning.window * np.exp(-2j * np.pi * turns[:, None] * position)
    image = []
    for away in np.linspace(-1, 1, 21) * tuning.half_width_hz / tuning.sample_rate_hz:
        beat = np.exp(2j * np.pi * (turns[:, None] + away) * position)
        seen, wanted = np.sum(taps * beat, axis=1), np.sum(exact * beat, axis=1)
        assert np.max(np.abs(np.angle(seen / wanted))) < 1e-12
        assert np.max(np.abs(seen / wanted - 1)) < 1e-4
        image.append(np.abs(np.sum(taps * beat.conj(), axis=1) / seen))
    assert np.max(image) < 10 ** (-85 / 20)  # 3 pm
    assert np.max(image[10]) < 2e-7  # none on the oscillator itself
    assert np.max(np.sum(np.abs(taps) ** 2, axis=1) / np.sum(np.abs(exact) ** 2, axis=1)) < 1.0001


def test_a_constant_offset_is_removed() -> None:
    tuning = TUNINGS[0]
    whole, _ = _whole(tuning, 1234.5)
    assert np.allclose(whole[1][:, 2], 1234.5 * _restored(whole, tuning.length).sum(axis=1).real, atol=1e-4)
    assert not whole[0][:, 1].sum(axis=1).any()


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


@pytest.mark.parametrize(
    ("avx", "name", "features", "has"),
    [
        (1, None, "+sse2,+avx,+avx2,+fma", True),
        (1, None, "+sse2,+avx,-avx2", False),  # a processor without the instruction would end the program
        (1, None, "+avx2vnni", False),
        (0, None, "+sse2,+avx,+avx2", False),  # numba is told to do without
        (1, "generic", None, False),  # kernels for any processor of the kind
        (1, "generic", "+avx2", True),
    ],
)
def test_products_of_pairs_are_added_at_once_where_the_processor_compiled_for_does_so(
    avx: int, name: str | None, features: str | None, has: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key, value in (("ENABLE_AVX", avx), ("CPU_NAME", name), ("CPU_FEATURES", features)):
        monkeypatch.setattr(config, key, value)
    assert has_multiply_add() is has
