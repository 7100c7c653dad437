"""Find the place and number of samples that a digitizer lost without reporting it, from jumps of both beats' phases.

A missing sample advances the rest beat by f/fs of a cycle, whatever the block does.  A jump of PD0's phase within one
sample is therefore a loss.  The size of the jump gives the number of samples up to whole periods of the beat, and PD1,
at another frequency, decides among those.  A loss of whole periods leaves PD0 unchanged; then only PD1 jumps, by the
block's displacement during the loss.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from analysis.shot import Floats, Gap, Recording, Role
from analysis.signal.filters import stretches
from analysis.signal.rest import LossResiduals, cumulative, phase_jump, tone_columns
from analysis.signal.track import Track

SAMPLES_LOST = "samples_lost"
STEP_SAMPLES = 16  # motion samples: more than the decimator's length
SUSPECT_SIGMAS = 8.0
SUSPECT_CYCLES = 0.01  # smallest jump that is examined
SHORTEST_BLOCK, LONGEST_BLOCK = 64, 1024
BLOCK_PERIODS = 8.0  # shortest block, in periods of the beat and of its distance from the mirror image
JUMP_CYCLES = 0.006  # smallest jump of a block's phase
SIDE_BLOCKS = 8  # blocks of samples on each side from which a jump is measured
PD0_CYCLES, PD1_CYCLES = 0.003, 0.04  # three standard deviations of a measured jump (PD0: at least)
MAX_SINGLE_SAMPLES = 64  # any loss of up to this many samples is considered ...
PACKET, MAX_LOST = 64, 8192  # ... and larger ones in whole packets of a transfer
MAX_LOSSES = 200
CLOSE_BLOCKS = 3  # shortest blocks within which two losses are examined together
PD1_JUMP_SIGMAS, PD1_JUMP_CYCLES = 10.0, 0.02  # least fourth difference of the moving beat's phase at a jump
PD1_GUARD, PD1_SIDE = 256, 2048  # samples: uncertainty of a jump's place, reach of the extrapolation
PD1_REACH = PD1_SIDE + 64  # samples examined on each side of a jump


def has_phase_jumps(reference: Track) -> bool:
    """Return whether the rest beat's phase jumps by more than noise anywhere.  Cost: one pass over the samples."""
    step = reference.phase_cycles[STEP_SAMPLES:] - reference.phase_cycles[:-STEP_SAMPLES]
    step = step[np.isfinite(step)]
    if step.size < 8 * STEP_SAMPLES:
        return False
    step = _wrapped(step - np.median(step))
    usual = 1.4826 * float(np.median(np.abs(step)))
    return bool(np.abs(step).max() > max(SUSPECT_CYCLES, SUSPECT_SIGMAS * usual))


def phase_jump_samples(moving: Track) -> list[int]:
    """Return the motion samples near which the moving beat's phase jumps faster than in any collision.

    A jump appears in the fourth difference over the whole length of the decimator.  A force that starts abruptly moves
    the block by less than a nanometre within one sample.  Cost: one pass over the motion samples.
    """
    bend = np.abs(np.diff(moving.phase_cycles, 4))
    known = np.isfinite(bend)
    if np.count_nonzero(known) < 8 * STEP_SAMPLES:
        return []
    usual = 1.4826 * float(np.median(bend[known]))
    over = np.flatnonzero(known & (bend > max(PD1_JUMP_CYCLES, PD1_JUMP_SIGMAS * usual)))
    runs = np.split(over, np.flatnonzero(np.diff(over) > STEP_SAMPLES) + 1)
    return [int(run[bend[run].argmax()]) + 2 for run in runs if run.size]


def find_losses(recording: Recording, rest_hz: float, pd1_jumps: Sequence[int] = ()) -> tuple[Gap, ...]:
    """Return the losses found from both beats, without those already known as gaps; the recording has both channels.

    ``pd1_jumps`` are the stored samples near which PD1 jumps (``phase_jump_samples``); where PD0 does not jump, whole
    periods of PD0's beat may be missing.  Cost: some 10 ms per million samples, and 1 ms per loss.
    """
    turns = rest_hz / recording.sample_rate_hz
    block = _block_samples(turns)
    if block is None:
        return ()
    reference, moving = recording.counts_of(Role.REFERENCE), recording.counts_of(Role.MEASUREMENT)
    turns, places = _jumps(reference, turns, block)
    known = np.array([gap.sample_start for gap in recording.gaps], dtype=np.int64)
    places = _merge_clusters([at for at in places if not known.size or np.abs(known - at).min() > 2 * block])
    if len(places) > MAX_LOSSES:
        return ()
    found = _losses_at(places, reference, moving, SIDE_BLOCKS * block, turns)
    taken = np.array([*places, *known], dtype=np.int64)
    for near in pd1_jumps:
        if taken.size and np.abs(taken - near).min() < 2 * block:
            continue
        first, last = max(near - PD1_REACH, 0), min(near + PD1_REACH, reference.size)
        whole = _whole_periods(reference[first:last], moving[first:last], near - first, turns)
        if whole is None:
            continue
        at = first + whole.sample_start
        if all(abs(at - gap.sample_start) > 2 * block for gap in found):  # otherwise it is a loss already found
            found.append(Gap(at, whole.samples_lost))
    return tuple(sorted(found, key=lambda gap: gap.sample_start))


def _block_samples(turns: float) -> int | None:
    """Return the block that distinguishes a beat, of ``turns`` cycles per sample, from its mirror image; else None."""
    image = min(abs(2.0 * turns - round(2.0 * turns)), 0.5)
    if not 0.0 < turns < 0.5 or image < BLOCK_PERIODS / LONGEST_BLOCK:
        return None
    block = int(np.clip(np.ceil(BLOCK_PERIODS / min(image, turns)), SHORTEST_BLOCK, LONGEST_BLOCK))
    return block + block % 2


def _losses_at(
    places: Sequence[int], reference: NDArray[np.int16], moving: NDArray[np.int16], side: int, turns: float
) -> list[Gap]:
    """Return the losses near each of ``places``, from at most ``side`` samples on either side of it."""
    found = []
    bounds = [0, *((one + other) // 2 for one, other in itertools.pairwise(places)), reference.size]
    for at, low, high in zip(places, bounds[:-1], bounds[1:], strict=False):
        first, last = max(at - side, low), min(at + side, high)
        gaps = _losses_near(reference[first:last], moving[first:last], at - first, turns)
        found += [Gap(first + gap.sample_start, gap.samples_lost) for gap in gaps]
    return found


def _wrapped(cycles: Floats) -> Floats:
    return np.asarray(cycles - np.rint(cycles))


def _block_phases(values: Floats, turns: float, block: int) -> tuple[Floats, Floats]:
    """Return the phase in cycles relative to an oscillator, and the amplitude, of half-overlapping blocks, (n,)."""
    count = values.size // (block // 2) - 1
    halves = values[: (count + 1) * (block // 2)].reshape(count + 1, block // 2)
    window = np.hanning(block + 1)[:-1]
    tone = window * np.exp(-2j * np.pi * turns * np.arange(block))
    mixed = halves[:-1] @ tone[: block // 2] + halves[1:] @ tone[block // 2 :]
    begin = np.arange(count) * (block // 2)
    cycles = np.angle(mixed) / (2 * np.pi) - np.remainder(turns * begin, 1.0)
    return _wrapped(cycles), np.abs(mixed) * 2.0 / window.sum()


def _jumps(counts: NDArray[np.int16], turns: float, block: int) -> tuple[float, list[int]]:
    """Return the beat's frequency in cycles per sample, and the samples near which its phase jumps."""
    values = counts.astype(np.float64)
    values -= values.mean()
    phase, size = _block_phases(values, turns, block)
    per_block = float(np.median(_wrapped(np.diff(phase))))
    step = _wrapped(phase[4:] - phase[:-4] - 4 * per_block)  # of blocks separated by one block
    bright = size > 0.5 * float(np.median(size))
    lit = bright[4:] & bright[:-4]  # a jump of half a cycle cancels the amplitude only of the block that contains it
    usual = 1.4826 * float(np.median(np.abs(step)))
    over = lit & (np.abs(step) > max(JUMP_CYCLES, SUSPECT_SIGMAS * usual))
    places = []
    for start, stop in stretches(over):
        # all pairs of blocks that enclose a jump show it, so it lies in the middle of these pairs
        strong = start + np.flatnonzero(np.abs(step[start:stop]) > 0.7 * np.abs(step[start:stop]).max())
        places.append(int((0.5 * (strong[0] + strong[-1]) + 3.0) * (block // 2)))
    return turns + per_block / (block // 2), places


def _merge_clusters(places: list[int]) -> list[int]:
    """Return the places with clusters replaced by their mean."""
    joined: list[list[int]] = []
    for at in places:
        if joined and at - joined[-1][0] <= CLOSE_BLOCKS * SHORTEST_BLOCK:
            joined[-1].append(at)
        else:
            joined.append([at])
    return [sum(together) // len(together) for together in joined]


def _losses_near(reference: NDArray[np.int16], moving: NDArray[np.int16], near: int, turns: float) -> tuple[Gap, ...]:
    """Return the loss, or two losses close together, near sample ``near`` of a stretch of both beats; () if none."""
    x, beat = reference.astype(np.float64), moving.astype(np.float64)
    room = min(near // 2, (x.size - near) // 2)
    guard = min(SHORTEST_BLOCK, room)
    if guard < 32:
        return ()
    one = LossResiduals.of(x, near, guard, turns)
    place = int((one.before - one.after).argmin())
    if one.before[place] - one.after[place] + one.after[-1] <= one.limit:
        at = near - guard + place
        gap = _likely_loss(at, turns, one.jump, one.sigma, _moving_jump(beat, at))
        return () if gap is None else (gap,)
    guard = min(CLOSE_BLOCKS * SHORTEST_BLOCK, room)
    two = LossResiduals.of(x, near, guard, turns)
    left, place, lasts, count = two.two_losses(turns)
    at = near - guard + place
    whole = _likely_loss(at, turns, two.jump, two.sigma, _moving_jump(beat, at, lasts)) if left <= two.limit else None
    if whole is None or whole.samples_lost is None or whole.samples_lost <= count:
        return ()
    return Gap(at, count), Gap(at + lasts, whole.samples_lost - count)


def _likely_loss(at: int, turns: float, jump: float, sigma: float, moved: tuple[float, float] | None) -> Gap | None:
    """Return the loss whose size explains the jumps of both beats, ``jump`` and ``moved``; None if no size does."""
    lost = np.concatenate([np.arange(1, MAX_SINGLE_SAMPLES + 1), np.arange(2 * PACKET, MAX_LOST + 1, PACKET)])
    misfit = (_wrapped(lost * turns - jump) / max(PD0_CYCLES / 3.0, sigma)) ** 2
    if moved is not None:
        misfit += (_wrapped(lost * moved[0] - moved[1]) / (PD1_CYCLES / 3.0)) ** 2
    best = int((misfit + 2.0 * np.log(lost)).argmin())  # a small loss is likelier than a large one
    return Gap(at, int(lost[best])) if misfit[best] < 16.0 else None


def _whole_periods(reference: NDArray[np.int16], moving: NDArray[np.int16], near: int, turns: float) -> Gap | None:
    """Return the loss of whole periods of the rest beat near sample ``near``, or None.

    The loss is placed where the moving beat, extrapolated from both sides, has the smallest residual.
    """
    x = moving - moving.mean()
    spans = (slice(max(0, near - PD1_SIDE), near - PD1_GUARD), slice(near + PD1_GUARD, near + PD1_SIDE))
    within = np.arange(near - PD1_GUARD, near + PD1_GUARD)
    errors = []
    for span in spans:
        cycles = _side_phase(x, span, near)
        if cycles is None:
            return None
        index = np.arange(x.size)[span]
        level = np.linalg.lstsq(tone_columns(cycles(index - near)), x[span], rcond=None)[0]
        errors.append((x[within] - tone_columns(cycles(within - near)) @ level) ** 2)
    at = near - PD1_GUARD + int(cumulative(errors[0] - errors[1]).argmin())
    moved = _moving_jump(x, at)
    if moved is None or abs(moved[1]) < PD1_CYCLES:
        return None
    y = reference - reference.mean()
    sides = (slice(0, at - 2), slice(at + 2, y.size))
    tone = tone_columns(turns * np.arange(y.size))
    jump = phase_jump([np.linalg.lstsq(tone[side], y[side], rcond=None)[0] for side in sides])
    return _likely_loss(at, turns, float(_wrapped(np.array(jump))), 0.0, moved)


def _moving_jump(x: Floats, at: int, lasts: int = 0) -> tuple[float, float] | None:
    """Return the moving beat's (cycles per sample, jump in cycles) at sample ``at``; None if the beat is not visible.

    The ``lasts`` samples from ``at`` on are ignored.
    """
    before, after = (_side_phase(x - x.mean(), side, at) for side in (slice(0, at - 2), slice(at + lasts + 2, x.size)))
    if before is None or after is None:
        return None
    turns = 0.5 * (float(before.deriv()(0.0)) + float(after.deriv()(0.0)))
    return turns, float(_wrapped(np.array(float(after(0.0)) - float(before(0.0)))))


def _side_phase(x: Floats, side: slice, at: int) -> Polynomial | None:
    """Return a polynomial of a beat's phase in cycles, over samples from ``at``, fitted to one side; None if dark."""
    block = 64
    part = x[side]
    if part.size < 4 * block:
        return None
    spectrum = np.abs(np.fft.rfft(part * np.hanning(part.size), 4 * part.size))
    spectrum[: max(4, spectrum.size // 100)] = 0.0
    turns = float(spectrum.argmax()) / (4 * part.size)
    phase, size = _block_phases(part, turns, block)
    if size.min() < 0.3 * np.median(size):
        return None
    first = side.start - at
    centre = first + (np.arange(phase.size) + 1) * (block // 2)
    total = np.unwrap(phase, period=1.0) + turns * (centre - first)
    return Polynomial.fit(centre, total, 2 if phase.size >= 8 else 1).convert(domain=[-1, 1])
