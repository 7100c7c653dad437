"""Read the phases of a recording's beats on the motion's time grid, in parallel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import side_by_side
from analysis.shot import AnalysisError, Cancelled, Floats, Gap, Progress, Recording, Stop
from analysis.signal.beat import BeatReader
from analysis.signal.bridge import Bridge, Segment
from analysis.signal.decimate import PhaseDecimator, noise_ratio
from analysis.signal.noise import local_variance
from analysis.signal.survey import Survey
from analysis.signal.tuning import BATCH, PHASE_STEPS, OscillatorSchedule, Tuning

BLOCK_SAMPLES = 1 << 19  # samples read at a time without the interpreter's lock
MIN_MOTION_SAMPLES = 64
DARK_SHARE = 0.3  # of the surveyed amplitude, below which the phase is not usable
_STEADY_VARIANCE = 0.005  # relative variance of the power's box means: noise alone is not mistaken for darkness


@dataclass(frozen=True, slots=True)
class BeatSpec:
    """One beat to read: its column, band-pass, oscillators and survey."""

    tuning: Tuning
    schedule: OscillatorSchedule
    column: int
    survey: Survey


@dataclass(frozen=True, slots=True)
class Track:
    """One beat on the motion's grid; arrays of shape (n,), NaN where not measured."""

    phase_cycles: Floats  # relative to the oscillator
    std_cycles: Floats
    amplitude_counts: Floats
    hole: NDArray[np.bool_]  # True where not measured; bridged where possible
    breaks: tuple[int, ...]  # first samples after holes that could not be bridged
    doubtful: int  # number of bridges that may be wrong by a fringe
    oscillator_hz: float
    spec: BeatSpec

    def offset_hz(self, grid: "Grid") -> Floats:
        """Return the beat's frequency minus that of the oscillator it was read with, shape (n - 1,); NaN if unknown."""
        tuning, schedule = self.spec.tuning, self.spec.schedule
        factor = grid.step // tuning.decimation
        batch = ((np.arange(self.phase_cycles.size - 1) + 6) * factor + factor // 2) // BATCH
        steps = schedule.steps[schedule.batch[np.minimum(batch, schedule.batch.size - 1)]]
        oscillator = steps * (tuning.sample_rate_hz / (tuning.decimation * PHASE_STEPS))
        return np.asarray(self.oscillator_hz + np.diff(self.phase_cycles) * grid.rate_hz - oscillator)


@dataclass(frozen=True, slots=True)
class Grid:
    """The motion's uniform time grid with a spacing of ``step`` recorded samples, lost samples included.

    ``pieces`` are (start, stop, index of start with lost samples counted) of the stretches without a loss.
    """

    input_rate_hz: float
    step: int
    samples: int
    pieces: tuple[tuple[int, int, int], ...]

    @classmethod
    def of(cls, recording: Recording, step: int) -> "Grid":
        """Return the grid of a recording, or of its longest part without a loss of unknown length.

        Raises AnalysisError if that part is too short for a motion.
        """
        longest: tuple[tuple[int, int, int], ...] = ()
        current: list[tuple[int, int, int]] = []
        start, shift = 0, 0
        for gap in (*recording.bridgeable_gaps, Gap(recording.samples)):
            current.append((start, gap.sample_start, start + shift))
            start = gap.sample_start
            if gap.samples_lost is not None:
                shift += gap.samples_lost
                continue
            if not longest or current[-1][1] - current[0][0] > longest[-1][1] - longest[0][0]:
                longest = tuple(current)
            current, shift = [], 0
        pieces = longest
        true_stop = pieces[-1][2] + pieces[-1][1] - pieces[-1][0]
        samples = true_stop // step
        if samples < MIN_MOTION_SAMPLES:
            raise AnalysisError(
                f"too short: {recording.samples} samples give {samples} of motion (at least {MIN_MOTION_SAMPLES})"
            )
        return cls(recording.sample_rate_hz, step, samples, pieces)

    @property
    def rate_hz(self) -> float:
        return self.input_rate_hz / self.step

    def time_s(self, tuning: Tuning) -> Floats:
        """Return the times, shape (samples,), on which motion samples of a beat read with ``tuning`` are centred.

        Half the decimator (6 steps) and half the band-pass lie before a sample's centre.
        """
        centre = (np.arange(self.samples) + 6) * self.step + tuning.delay_samples
        return np.asarray(centre / self.input_rate_hz)

    def stored_sample(self, place: int, tuning: Tuning) -> int:
        """Return the stored sample on which motion sample ``place`` of a beat read with ``tuning`` is centred."""
        centre = int((place + 6) * self.step + tuning.delay_samples)
        start, stop, first = next(piece for piece in reversed(self.pieces) if piece[2] <= centre or piece[2] == 0)
        return min(start + centre - first, stop - 1)


def read_tracks(
    recording: Recording,
    wanted: list[BeatSpec],
    grid: Grid,
    progress: Progress | None,
    cancelled: Stop | None,
) -> list[Track]:
    """Read every beat over the whole recording, in parallel, as the kernels release the interpreter's lock.

    Memory: one block per beat in addition to the motion's arrays.  Raises Cancelled.
    """
    done = [0.0] * len(wanted)

    def track(place: int) -> Track:
        def advance(samples: int) -> None:
            done[place] += samples / recording.samples
            if cancelled is not None and cancelled():
                raise Cancelled
            if progress is not None and place == 0:
                progress("demodulating", min(1.0, sum(done) / len(done)))

        return _read(recording, wanted[place], grid, advance)

    return side_by_side(track, range(len(wanted)))


def _read(recording: Recording, wanted: BeatSpec, grid: Grid, advance: Callable[[int], None]) -> Track:
    tuning = wanted.tuning
    factor = grid.step // tuning.decimation
    phase = np.full(grid.samples, np.nan)
    description = np.full((2, grid.samples), np.nan)
    variance = 1.0 / (10 ** (wanted.survey.snr_db / 10) * tuning.effective_samples)
    bridge = Bridge(
        (0.5 * DARK_SHARE * wanted.survey.amplitude_counts) ** 2,
        max(1, int(np.ceil(variance / _STEADY_VARIANCE))),
        -(-tuning.length // tuning.decimation),
    )
    decimator: PhaseDecimator | None = None
    expected = -1

    def take(segments: list[Segment]) -> None:
        nonlocal decimator, expected
        for first, fine, power in segments:
            if decimator is None or first != expected:
                decimator = PhaseDecimator(factor, first, tuning.spread)
            expected = first + fine.size
            start, values, about = decimator.feed(fine, power)
            last = max(start, min(start + values.size, grid.samples))
            phase[start:last] = values[: last - start]
            description[:, start:last] = about[:, : last - start]

    oscillator_hz = 0.0
    for start, stop, true_start in grid.pieces:
        reader = BeatReader(tuning, wanted.schedule, wanted.column, wanted.survey.offset_counts, true_start)
        oscillator_hz = reader.oscillator_hz
        for block in range(start, stop, BLOCK_SAMPLES):
            end = min(stop, block + BLOCK_SAMPLES)
            take(bridge.feed(*reader.feed(recording.counts[block:end])))
            advance(end - block)
        take(bridge.feed(*reader.finish()))
    take(bridge.finish())

    hole = np.zeros(grid.samples, bool)
    for first, last in bridge.holes:
        hole[max(0, (first - factor // 2) // factor - 6) : max(0, -(-(last + factor // 2) // factor) - 6)] = True
    rough = np.where(hole, np.nan, description[1])
    std = np.sqrt(local_variance(rough)) * noise_ratio(tuning, factor)
    breaks = tuple(-(-first // factor) for first in bridge.breaks)
    amplitude = 2 * np.sqrt(description[0])
    return Track(phase, std, amplitude, hole, breaks, bridge.doubtful, oscillator_hz, wanted)
