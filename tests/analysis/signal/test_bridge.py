"""Fringes are kept over holes, however close together, and however the phases were cut into blocks."""

import numpy as np
import pytest

from analysis.signal.bridge import Bridge

SLOPE, BEND = 0.137, 2e-5  # cycles a phase: several fringes over a hole


def _bridged(cuts: list[int], holes: list[tuple[int, int]]) -> tuple[np.ndarray, Bridge]:
    """Return what a bridge gives out of a bent phase that a whole number of cycles is lost of at every hole."""
    index = np.arange(3000)
    phase = SLOPE * index + BEND * index**2
    power = np.ones(index.size, np.float32)
    for number, (start, stop) in enumerate(holes):
        power[start:stop] = 0.0
        phase[stop:] += 3.0 + number  # a beat is known but for whole cycles
        phase[start:stop] = 0.4
    bridge = Bridge(0.3, 4, 3)
    out = np.full(index.size, np.nan)
    for first, last in zip([0, *cuts], [*cuts, index.size], strict=True):
        for at, piece, _ in bridge.feed(first, phase[first:last], power[first:last]):
            out[at : at + piece.size] = piece
    for at, piece, _ in bridge.finish():
        out[at : at + piece.size] = piece
    return out - (SLOPE * index + BEND * index**2), bridge


@pytest.mark.parametrize("apart", [9, 14, 22, 60])
def test_no_fringe_is_lost_between_holes_close_together(apart: int) -> None:
    left, bridge = _bridged([1000, 2000], [(700, 708), (708 + apart, 716 + apart), (1700, 1712)])
    assert np.abs(left).max() < 0.02
    assert bridge.doubtful == 0 and not bridge.breaks


def test_the_result_does_not_depend_on_the_blocks() -> None:
    holes = [(700, 708), (722, 730), (735, 741)]
    whole, _ = _bridged([], holes)
    for cut in range(690, 760, 3):
        assert np.array_equal(_bridged([cut], holes)[0], whole)
