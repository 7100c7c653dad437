"""The beat's band-pass in integers: its taps, and the processor's multiply-add and prefetch instructions.

16-bit samples are multiplied with 16-bit taps and summed in 32 bits.  A processor multiplies sixteen pairs of 16-bit
numbers and adds neighbouring products in one instruction, twice as many as in single precision.  Sums of integers are
exact in any order.  The compiler does not choose this instruction for a loop that reuses samples and taps, so it is
called by name.
"""

from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import config, njit, types
from numba.core import cgutils as _cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

_MOST = 65535  # limit of the taps' absolute sum: sums of full-scale 16-bit samples then stay below 2^31
_LARGEST = 32700
_STRAY = 2.0  # largest change of one tap by rounding, with two errors carried forward
cgutils: Any = _cgutils
LINE_BYTES = 64  # bytes of memory fetched at once
_READ, _SECOND_CACHE, _DATA = 0, 2, 1  # in the first cache a prefetched line would displace data in use
WIDTH = 16  # samples multiplied by one instruction; taps are padded to a multiple of it
TOGETHER = 4  # outputs that share each load of the taps
_I16, _I32 = ir.IntType(16), ir.IntType(32)
_SAMPLES, _SUMS = ir.VectorType(_I16, WIDTH), ir.VectorType(_I32, WIDTH // 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _round(window, turns, room, taps, gains):  # type: ignore[no-untyped-def]
    """Mix a symmetric window with oscillators and round the taps to integers; 10 ns per tap.

    Each rounding error is carried to the next two taps: the total error e[k] - 2 cos(w) e[k-1] + e[k-2] has a zero at
    +-w, the oscillator's frequency.  Errors are carried towards the centre, where the last one shifts no phase.
    """
    length = window.shape[0]
    half = length // 2
    cosine, sine = np.empty(half), np.empty(half)
    for row in range(turns.shape[0]):
        step = 2.0 * np.pi * turns[row]
        even_sum, odd_sum, largest = 0.0, 0.0, 0.0
        for k in range(half):
            angle = step * (k - 0.5 * (length - 1))
            cosine[k], sine[k] = np.cos(angle), -np.sin(angle)
            even_sum += 2 * abs(window[k] * cosine[k])
            odd_sum += 2 * abs(window[k] * sine[k])
            largest = max(largest, abs(window[k]))
        scale = min(room / max(even_sum, odd_sum), _LARGEST / largest)
        twice = 2.0 * np.cos(step)
        for part in range(2):
            mirrored = 1 - 2 * part
            wave = sine if part else cosine
            last, before, gain = 0.0, 0.0, 0.0
            for k in range(half):
                wanted = scale * window[k] * wave[k] - twice * last + before
                nearest = np.rint(wanted)
                before, last = last, nearest - wanted
                gain += 2 * nearest * wave[k]
                taps[row, part, k] = np.int16(nearest)
                taps[row, part, length - 1 - k] = np.int16(mirrored * nearest)
            gains[row, part] = 0.5 / gain


def integer_taps(
    window: NDArray[np.float64], turns: NDArray[np.float64], offset_counts: float
) -> tuple[NDArray[np.int16], NDArray[np.float32]]:
    """Return ``window`` mixed with each oscillator, as integers of the largest scale that cannot overflow, and gains.

    Taps int16 (oscillators, 2, length rounded up to ``WIDTH``): real part, even about the centre, and imaginary part,
    odd.  Gains float32 (oscillators, 3): those that scale the sums of both parts back to counts, and the contribution
    of a constant offset to the first sum; the second sum is unaffected by an offset.

    ``window`` is symmetric with an even number of taps.  ``turns`` (oscillators,) are the oscillators in cycles per
    sample; their phase is zero at the window's centre, so the phase read is the beat's there for any oscillator.
    The taps are even and odd functions, so they shift no phase at any frequency.  At the oscillator's frequency the
    gains of both parts, and therefore the rejection of the image, are exact.
    """
    taps = np.zeros((turns.size, 2, -(-window.size // WIDTH) * WIDTH), np.int16)
    gains = np.empty((turns.size, 2))
    _round(np.asarray(window).copy(), turns, _MOST - _STRAY * window.size, taps, gains)
    steady = offset_counts * gains[:, :1] * taps[:, 0].sum(axis=1, dtype=np.int64)[:, None]
    return taps, np.concatenate((gains, steady), axis=1).astype(np.float32)


def has_multiply_add() -> bool:
    """Return whether kernels are compiled for a processor with 16-bit multiply-add (x86 with AVX2)."""
    settings = vars(config)
    named = settings["CPU_FEATURES"]
    if named is None:
        named = "" if settings["CPU_NAME"] else binding.get_host_cpu_features().flatten()
    return bool(settings["ENABLE_AVX"]) and "+avx2" in named.split(",")


def _shuffled(builder: Any, a: Any, b: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_I32, len(places)), places))


def _products(builder: Any, x: Any, taps: Any, native: bool) -> Any:
    """Return eight sums of two products each; the pairing differs by processor but not the sum over all eight."""
    if native:
        kind = ir.FunctionType(_SUMS, [_SAMPLES, _SAMPLES])
        instruction = cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.avx2.pmadd.wd")
        return builder.call(instruction, [x, taps])
    total = None
    for first in (0, WIDTH // 2):
        half = list(range(first, first + WIDTH // 2))
        wide = [builder.sext(_shuffled(builder, v, v, half), _SUMS) for v in (x, taps)]
        product = builder.mul(*wide)
        total = product if total is None else builder.add(total, product)
    return total


def _summed(builder: Any, vectors: list[Any]) -> Any:
    """Return one vector of the eight sums over each of eight vectors, in their order, by three rounds of halving."""
    lanes = len(vectors)
    stretch = lanes
    while stretch > 1:
        half = stretch // 2
        near = [lanes * v + s + k for v in (0, 1) for s in range(0, lanes, stretch) for k in range(half)]
        far = [place + half for place in near]
        vectors = [
            builder.add(_shuffled(builder, a, b, near), _shuffled(builder, a, b, far))
            for a, b in zip(vectors[::2], vectors[1::2], strict=True)
        ]
        stretch = half
    return vectors[0]


def make_four_dots(native: bool) -> Any:
    """Return ``four_dots(samples, start, stride, taps, out, place)`` for kernels to call.

    ``samples`` int16 (n,); ``taps`` int16 (2, a multiple of 16); ``out`` int32 (2, m).  The function writes
    ``out[r, place + j] = sum_k taps[r, k] samples[start + j stride + k]`` for j of 0 to 3, modulo 2^32: exact as long
    as 32768 times the taps' absolute sum stays below 2^31.  Bounds are not checked.
    Costs 1/80 ns per product, 0.1 ns per input sample if each sample serves four outputs.
    """

    @intrinsic
    def four_dots(  # type: ignore[no-untyped-def]
        typing_context, samples, start, stride, taps, out, place
    ):
        del typing_context

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            def array(which: int) -> Any:
                return context.make_array(signature.args[which])(context, builder, arguments[which])

            def load(base: Any, place: Any) -> Any:
                at = builder.bitcast(builder.gep(base, [place]), _SAMPLES.as_pointer())
                return builder.load(at, align=2)

            start, stride, place = arguments[1], arguments[2], arguments[5]
            samples, taps, out = array(0), array(3), array(4)
            word = start.type
            length = cgutils.unpack_tuple(builder, taps.shape)[1]
            columns = cgutils.unpack_tuple(builder, out.shape)[1]
            sums = [cgutils.alloca_once_value(builder, ir.Constant(_SUMS, None)) for _ in range(2 * TOGETHER)]
            starts = [builder.add(start, builder.mul(stride, word(j))) for j in range(TOGETHER)]
            with cgutils.for_range(builder, builder.udiv(length, word(WIDTH))) as loop:
                first = builder.mul(loop.index, word(WIDTH))
                rows = [load(taps.data, first), load(taps.data, builder.add(length, first))]
                for j in range(TOGETHER):
                    x = load(samples.data, builder.add(starts[j], first))
                    for row in range(2):
                        total = sums[row * TOGETHER + j]
                        more = _products(builder, x, rows[row], native)
                        builder.store(builder.add(builder.load(total), more), total)
            result = _summed(builder, [builder.load(total) for total in sums])
            for row in range(2):
                part = _shuffled(builder, result, result, [row * TOGETHER + j for j in range(TOGETHER)])
                at = builder.gep(out.data, [builder.add(builder.mul(columns, word(row)), place)])
                builder.store(part, builder.bitcast(at, part.type.as_pointer()), align=4)
            return context.get_dummy_value()

        return types.void(samples, types.intp, types.intp, taps, out, types.intp), generate

    return four_dots


four_dots = make_four_dots(has_multiply_add())


def _prefetch(typing_context, array, index):  # type: ignore[no-untyped-def]
    """Prefetch the memory line that contains ``array[index]``; an index out of bounds has no effect."""
    del typing_context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        fetch = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        builder.call(fetch, [address, number(_READ), number(_SECOND_CACHE), number(_DATA)])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


prefetch: Any = intrinsic(_prefetch)
