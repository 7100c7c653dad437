"""Fringes are kept over holes, however close together, and however the phases were cut into blocks."""

import numpy as np
import pytest

from analysis.signal.bridge import Bridge, join_stretches

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
    assert np.array_equal(_bridged(list(range(1, 760)), holes)[0], whole)  # one phase at a time


def test_holes_are_listed_with_their_guard_and_filled_smoothly() -> None:
    left, bridge = _bridged([], [(700, 712)])
    ((start, stop),) = bridge.holes
    assert 696 <= start <= 700 - 3 + 2 and 712 + 3 - 2 <= stop <= 716  # dark where a mean of 4 is below, 3 more
    assert np.abs(left).max() < 1e-6  # a parabola is bridged without error
    assert np.abs(np.diff(left, 2)).max() < 1e-6


@pytest.mark.parametrize(("offset", "doubtful"), [(0.2, 0), (0.3, 1), (-0.2, 0), (-0.3, 1)])
def test_a_bridge_whose_sides_differ_by_a_quarter_of_a_fringe_is_doubtful(offset: float, doubtful: int) -> None:
    index = np.arange(2000)
    phase = SLOPE * index
    phase[1000:] += 5.0 + offset
    power = np.ones(2000, np.float32)
    power[990:1010] = 0.0
    bridge = Bridge(0.3, 4, 3)
    out = np.concatenate([piece for _, piece, _ in [*bridge.feed(0, phase, power), *bridge.finish()]])
    assert bridge.doubtful == doubtful and out.size == 2000
    assert out[1100:] - SLOPE * index[1100:] == pytest.approx(offset, abs=1e-9)


@pytest.mark.parametrize(("missing", "bridged"), [(400, True), (401, False)])
def test_missing_phases_are_bridged_up_to_the_longest_and_break_the_record_beyond(missing: int, bridged: bool) -> None:
    bridge = Bridge(0.3, 4, 3)
    index = np.arange(4000)
    phase, power = 0.01 * index, np.ones(4000, np.float32)
    pieces = bridge.feed(0, phase[:1500], power[:1500])
    held = [(at, piece.copy()) for at, piece, _ in pieces]
    begins = 1500 + missing
    held += [(at, piece.copy()) for at, piece, _ in bridge.feed(begins, phase[begins:] + 7.0, power[begins:])]
    held += [(at, piece.copy()) for at, piece, _ in bridge.finish()]
    out = np.full(4000, np.nan)
    for at, piece in held:
        out[at : at + piece.size] = piece
    assert bridge.breaks == ([] if bridged else [begins])
    if bridged:
        (hole,) = bridge.holes
        assert hole[0] <= 1500 and hole[1] >= begins and hole[1] - hole[0] <= missing + 12
    else:
        assert bridge.holes == [(1500, begins)] and np.isnan(out[1500:begins]).all()
        assert out[begins:] == pytest.approx(phase[begins:] + 7.0)
    assert out[:1490] == pytest.approx(phase[:1490])


@pytest.mark.parametrize("shift", [-2.0, 0.0, 3.0, 0.3])
def test_stretches_behind_a_long_gap_are_joined_by_whole_fringes(shift: float) -> None:
    fringe, n = 316.4e-9, np.arange(600.0)
    true = 4e-7 * n + 1e-11 * n**2
    cut = true.copy()
    cut[300:330] = np.nan
    cut[330:] += shift * fringe
    out, unsure = join_stretches(cut, (330,), fringe)
    known = np.isfinite(cut)
    left = shift - round(shift)
    assert out[:300] == pytest.approx(true[:300], abs=1e-15)
    assert out[known][300:] - true[known][300:] == pytest.approx(left * fringe, abs=1e-3 * fringe)
    assert not unsure
    assert np.isnan(out[300:330]).all() and join_stretches(true, (), fringe)[1] is False


def test_a_gap_in_which_the_force_changed_leaves_the_position_unsure() -> None:
    fringe, n = 316.4e-9, np.arange(600.0)
    bent = 4e-7 * n + np.where(n > 275, 2e-9 * (n - 275) ** 2, 0.0)  # pushed from shortly before the gap on
    bent[300:330] = np.nan
    assert join_stretches(bent, (330,), fringe)[1]
    short = bent.copy()
    short[:290] = np.nan
    out, unsure = join_stretches(short, (330,), fringe)  # too little before it to tell anything
    assert np.array_equal(out, short, equal_nan=True) and not unsure


@pytest.mark.parametrize(("apart", "unsure"), [(0.18, False), (0.22, True)])
def test_a_join_is_unsure_where_half_as_many_samples_say_a_fifth_of_a_fringe_else(apart: float, unsure: bool) -> None:
    """A push in the outer half of the samples before the gap, which the inner half does not know."""
    fringe, n = 316.4e-9, np.arange(400.0)
    bump = np.where((n >= 152) & (n < 176), (n - 176) ** 2, 0.0)
    bump[200:] = np.nan
    bump[210:] = 0.0
    before, middle = np.arange(152, 200) - 204.5, 204.5
    moved = -np.polyval(np.polyfit(before, bump[152:200], 2), 0.0)
    assert middle > 200
    out, told = join_stretches(4e-7 * n + bump * apart * fringe / abs(moved), (210,), fringe)
    assert told is unsure
    assert np.isfinite(out[210:]).all()


@pytest.mark.parametrize(("left", "unsure"), [(0.38, False), (0.42, True)])
def test_a_join_that_misses_two_fifths_of_a_fringe_is_unsure(left: float, unsure: bool) -> None:
    fringe, n = 316.4e-9, np.arange(400.0)
    for sign in (1.0, -1.0):
        cut = 4e-7 * n + np.where(n >= 210, (3.0 + sign * left) * fringe, 0.0)
        cut[200:210] = np.nan
        assert join_stretches(cut, (210,), fringe)[1] is unsure


@pytest.mark.parametrize("known", [11, 12])
def test_twelve_samples_on_either_side_are_enough_to_join(known: int) -> None:
    fringe, n = 316.4e-9, np.arange(400.0)
    for side in (slice(0, 200 - known), slice(210 + known, 400)):
        cut = 4e-7 * n + np.where(n >= 210, 3.0 * fringe, 0.0)
        cut[200:210] = np.nan
        cut[side] = np.nan
        out, _ = join_stretches(cut, (210,), fringe)
        assert out[210] == pytest.approx(4e-7 * 210 + (3.0 * fringe if known < 12 else 0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("dark", "doubtful"), [((1000, 1380), 0), ((1000, 1500), 1), ((0, 500), 0), ((1500, 1998), 0), ((1500, 1980), 1)]
)
def test_a_darkness_too_long_to_bridge_is_doubtful_where_the_beat_is_seen_on_either_side(
    dark: tuple[int, int], doubtful: int
) -> None:
    index = np.arange(2000)
    power = np.where((index >= dark[0]) & (index < dark[1]), 0.0, 1.0).astype(np.float32)
    bridge = Bridge(0.3, 4, 3)
    pieces = [*bridge.feed(0, SLOPE * index, power), *bridge.finish()]
    assert bridge.doubtful == doubtful and len(bridge.holes) == 1 and bridge.breaks == []
    assert sum(piece.size for _, piece, _ in pieces) == 2000


def test_a_stretch_that_begins_late_has_no_hole_before_it() -> None:
    bridge = Bridge(0.3, 4, 3)
    pieces = [*bridge.feed(5000, SLOPE * np.arange(900), np.ones(900, np.float32)), *bridge.finish()]
    assert bridge.holes == [] == bridge.breaks and pieces[0][0] == 5000
    assert sum(piece.size for _, piece, _ in pieces) == 900
