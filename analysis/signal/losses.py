"""Samples that a digitizer lost without a word: where, and how many, from the jumps of both beats.

A sample that is missing moves the rest beat on by f/fs of a cycle, whatever the block does.  So a jump of PD0's phase
that is sharp to a sample is a loss; its size tells the number of samples but for whole periods of the beat, and PD1,
whose frequency is another one, tells between those.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Gap, Recording, Role
from analysis.signal.track import Track

Floats = NDArray[np.float64]

FLAG = "samples_lost"
APART = 16  # motion samples: beyond the decimator's own reach
SUSPECT_SIGMAS = 8.0
SUSPECT_CYCLES = 0.01  # of a jump that is looked at
SHORTEST_BLOCK, LONGEST_BLOCK = 64, 1024
BLOCK_PERIODS = 8.0  # of the beat and of its mirror image
JUMP_CYCLES = 0.006  # of a block's phase
SIDE_BLOCKS = 8  # of samples on each side that a jump is measured with
PD0_CYCLES, PD1_CYCLES = 0.003, 0.04  # to which jumps are known, at least
MOST_SINGLE = 64  # samples lost one by one ...
PACKET, MOST_LOST = 64, 8192  # ... or in the packets of a transfer
SHARP = 2.0  # of the noise beside it: a phase that moves during its jump is no loss
MOST_LOSSES = 200


def suspicious(reference: Track) -> bool:
    """Tell whether the rest beat's phase jumps anywhere beyond its noise.  Cost: one pass over the motion samples."""
    step = reference.phase_cycles[APART:] - reference.phase_cycles[:-APART]
    step = step[np.isfinite(step)]
    if step.size < 8 * APART:
        return False
    step = _wrapped(step - np.median(step))
    usual = 1.4826 * float(np.median(np.abs(step)))
    return bool(np.abs(step).max() > max(SUSPECT_CYCLES, SUSPECT_SIGMAS * usual))


def find_losses(recording: Recording, rest_hz: float) -> tuple[Gap, ...]:
    """Return the losses that both beats show, beside those that are known.

    Cost: some 10 ms a million samples, and 1 ms a loss.
    """
    column = recording.column(Role.REFERENCE)
    moving_column = recording.column(Role.MEASUREMENT)
    if column is None or moving_column is None:
        return ()
    turns = rest_hz / recording.sample_rate_hz
    image = min(abs(2.0 * turns - round(2.0 * turns)), 0.5)
    if not 0.0 < turns < 0.5 or image < BLOCK_PERIODS / LONGEST_BLOCK:
        return ()
    block = int(np.clip(np.ceil(BLOCK_PERIODS / min(image, turns)), SHORTEST_BLOCK, LONGEST_BLOCK))
    block += block % 2
    counts = recording.counts[:, column]
    turns, places = _jumps(counts, turns, block)
    known = np.array([gap.sample_start for gap in recording.gaps], dtype=np.int64)
    places = [at for at in places if not known.size or np.abs(known - at).min() > 2 * block]
    if len(places) > MOST_LOSSES:
        return ()
    found = []
    for number, at in enumerate(places):
        first = max(at - SIDE_BLOCKS * block, 0 if number == 0 else (places[number - 1] + at) // 2)
        last = min(at + SIDE_BLOCKS * block, counts.size)
        if number + 1 < len(places):
            last = min(last, (places[number + 1] + at) // 2)
        gap = _loss(
            recording.counts[first:last, column], recording.counts[first:last, moving_column], at - first, turns
        )
        if gap is not None:
            found.append(Gap(first + gap.sample_start, gap.samples_lost))
    return tuple(found)


def _wrapped(cycles: Floats) -> Floats:
    return np.asarray(cycles - np.rint(cycles))


def _block_phases(values: Floats, turns: float, block: int) -> tuple[Floats, Floats]:
    """Return phase in cycles, the oscillator taken off, and amplitude of blocks that overlap by half, (n,) each."""
    count = values.size // (block // 2) - 1
    halves = values[: (count + 1) * (block // 2)].reshape(count + 1, block // 2)
    window = np.hanning(block + 1)[:-1]
    tone = window * np.exp(-2j * np.pi * turns * np.arange(block))
    mixed = halves[:-1] @ tone[: block // 2] + halves[1:] @ tone[block // 2 :]
    begin = np.arange(count) * (block // 2)
    cycles = np.angle(mixed) / (2 * np.pi) - np.remainder(turns * begin, 1.0)
    return _wrapped(cycles), np.abs(mixed) * 2.0 / window.sum()


def _jumps(counts: NDArray[np.int16], turns: float, block: int) -> tuple[float, list[int]]:
    """Return the beat's cycles a sample, and about which samples its phase jumps."""
    values = counts.astype(np.float64)
    values -= values.mean()
    phase, size = _block_phases(values, turns, block)
    per_block = float(np.median(_wrapped(np.diff(phase))))
    step = _wrapped(phase[4:] - phase[:-4] - 4 * per_block)  # blocks that lie apart by a block's length
    bright = size > 0.5 * float(np.median(size))
    lit = bright[4:] & bright[:-4]  # between them a jump of half a cycle darkens its own block
    usual = 1.4826 * float(np.median(np.abs(step)))
    over = lit & (np.abs(step) > max(JUMP_CYCLES, SUSPECT_SIGMAS * usual))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(np.int8)))
    places = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        # a jump shows in all pairs of blocks that hold it between them: it lies in the middle of those
        strong = start + np.flatnonzero(np.abs(step[start:stop]) > 0.7 * np.abs(step[start:stop]).max())
        places.append(int((0.5 * (strong[0] + strong[-1]) + 3.0) * (block // 2)))
    return turns + per_block / (block // 2), places


def _loss(reference: NDArray[np.int16], moving: NDArray[np.int16], near: int, turns: float) -> Gap | None:
    """Return the loss about sample ``near`` of a stretch of both beats, None where it is none."""
    x = reference.astype(np.float64)
    guard = min(SHORTEST_BLOCK, near // 2, (x.size - near) // 2)
    if guard < 32:
        return None
    index = np.arange(x.size)
    tone = np.stack([np.cos(2 * np.pi * turns * index), np.sin(2 * np.pi * turns * index), np.ones(x.size)], axis=1)
    sides = (slice(0, near - guard), slice(near + guard, x.size))
    solutions = [np.linalg.lstsq(tone[side], x[side], rcond=None)[0] for side in sides]
    errors = [(x - tone @ solution) ** 2 for solution in solutions]
    noise = float(np.mean([error[side].mean() for error, side in zip(errors, sides, strict=True)]))
    within = slice(near - guard, near + guard)
    cost = np.concatenate([[0.0], np.cumsum(errors[0][within] - errors[1][within])])
    at = near - guard + int(cost.argmin())
    left = float(errors[0][near - guard : at].sum() + errors[1][at : near + guard].sum()) / (2 * guard)
    if left > SHARP * noise + 1.0:
        return None
    before, after = (float(np.arctan2(-s[1], s[0])) / (2 * np.pi) for s in solutions)
    jump = after - before
    amplitude = float(np.hypot(*solutions[0][:2]))
    sigma = np.sqrt(noise) / max(amplitude, 1e-9) / (2 * np.pi) * np.sqrt(4.0 / max(near - guard, 8))
    lost = np.concatenate([np.arange(1, MOST_SINGLE + 1), np.arange(2 * PACKET, MOST_LOST + 1, PACKET)])
    misfit = (_wrapped(lost * turns - jump) / max(PD0_CYCLES / 3.0, sigma)) ** 2
    moved = _moving_jump(moving.astype(np.float64), at, guard)
    if moved is not None:
        misfit += (_wrapped(lost * moved[0] - moved[1]) / (PD1_CYCLES / 3.0)) ** 2
    best = int((misfit + 2.0 * np.log(lost)).argmin())  # few are likelier than many
    return Gap(at, int(lost[best])) if misfit[best] < 16.0 else None


def _moving_jump(x: Floats, at: int, guard: int) -> tuple[float, float] | None:
    """Return cycles a sample and the jump in cycles of the moving beat at a sample; None where it is not seen."""
    block = 64
    x = x - x.mean()
    found = []
    for start, stop in ((0, at - 2), (at + 2, x.size)):
        part = x[start:stop]
        if part.size < 4 * block:
            return None
        spectrum = np.abs(np.fft.rfft(part * np.hanning(part.size), 4 * part.size))
        spectrum[: max(4, spectrum.size // 100)] = 0.0
        turns = float(spectrum.argmax()) / (4 * part.size)
        phase, size = _block_phases(part, turns, block)
        if size.min() < 0.3 * np.median(size):
            return None
        centre = start + (np.arange(phase.size) + 1) * (block // 2) - at
        total = np.unwrap(phase, period=1.0) + turns * (centre - (start - at))
        degree = 2 if phase.size >= 8 else 1
        line = np.polynomial.Polynomial.fit(centre, total, degree).convert(domain=[-1, 1])
        found.append((float(line(0.0)), float(line.deriv()(0.0))))
    (before, turns_before), (after, turns_after) = found
    return 0.5 * (turns_before + turns_after), float(_wrapped(np.array([after - before]))[0])
