"""Demodulate a running stream for the live display: frequency, velocity and force, block by block."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot import AnalysisError, Floats, Setup, wavelength_in_air_m
from analysis.signal.beat import BeatReader
from analysis.signal.decimate import PhaseDecimator, filtered, group_means
from analysis.signal.filters import derivative_filters
from analysis.signal.survey import survey
from analysis.signal.tuning import Tuning, fixed_schedule, tune

SURVEY_S = 2e-3  # length of stream that is surveyed to choose the band-passes
REST_MEMORY_S = 0.2  # averaging time of the rest frequency
PD0_READ_S, PD0_PERIOD_S = 0.025, 0.1  # LIVE reads PD0 for 25 ms of every 100 ms: 1 mHz of scatter at 37 dB
MAX_DOPPLER_HZ = 1.3e6
_REST_HALF_WIDTH_HZ = 80e3
_MIN_PHASE_RATE_HZ = 100e3
_GROUP = 8  # phases averaged before they are filtered, if their rate is far above the display's
_MIN_GROUPS = 16  # least number of groups per point of the display


@dataclass(frozen=True, slots=True)
class LiveChunk:
    """The output samples of one block on a uniform grid; arrays of shape (k,), k may be 0; NaN marks a gap."""

    time_s: Floats  # from the stream's first sample
    beat_frequency_hz: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    rest_frequency_hz: float | None
    problem: str | None  # the reason why nothing can be shown


class LiveDemodulator:
    """Demodulates a running stream at a display rate; used from one thread.

    The band-passes are chosen from the first ``SURVEY_S`` of stream (repeated until a beat is found); then both beats
    are followed.  The output lags the input by 3 / bandwidth.  Memory is that of a few blocks however long the stream.
    Raises AnalysisError at once if the rest frequency is neither recorded nor stated.
    """

    def __init__(
        self,
        sample_rate_hz: float,
        measurement_column: int,
        reference_column: int | None,
        setup: Setup,
        output_rate_hz: float = 10e3,
        bandwidth_hz: float = 1e3,
    ) -> None:
        if not sample_rate_hz > 0:
            raise AnalysisError(f"sample rate of {sample_rate_hz:g} Hz: must be above zero")
        if reference_column is None and not setup.rest_frequency_hz:
            raise AnalysisError("no rest frequency: neither a reference channel (PD0) nor rest_frequency_hz is given")
        self._rate = sample_rate_hz
        self._columns = (measurement_column, reference_column)
        self._setup = setup
        self._wanted_rate = output_rate_hz
        self._bandwidth = bandwidth_hz
        try:
            self._wavelength = wavelength_in_air_m(setup)
        except ValueError as problem:
            raise AnalysisError(str(problem)) from None
        self._sample = 0  # next input sample, lost samples counted
        self._survey_counts: list[NDArray[np.int16]] = []
        self._beats: list[_BeatStream] = []
        self._rest_hz: float | None = None if reference_column is not None else setup.rest_frequency_hz
        self._rest_weight = 0.0
        self._pd0_period_start = 0  # sample at which PD0's reading periods begin
        self._after_gap = False
        self._waiting: Floats | None = None  # of the moving beat, until the rest frequency is known
        self._problem: str | None = "looking for the beat"

    @property
    def rate_hz(self) -> float | None:
        """Get the rate of the display's points, close to ``output_rate_hz``; None before a beat is found."""
        return self._beats[0].rate_hz if self._beats else None

    def feed(self, counts: NDArray[np.int16]) -> LiveChunk:
        """Process the next counts, shape (n, channels), and return their output samples."""
        self._sample += counts.shape[0]
        if self._beats:
            return self._demodulate(counts)
        self._survey_counts.append(counts.copy())
        enough = max(4096, round(SURVEY_S * self._rate))
        if sum(block.shape[0] for block in self._survey_counts) < enough:
            return self._empty_chunk()
        seen = np.concatenate(self._survey_counts)
        self._survey_counts = []
        try:
            self._tune(seen[:enough])  # a fixed number, so that the result does not depend on the block size
        except AnalysisError as problem:
            self._problem = str(problem)
            return self._empty_chunk()
        self._problem = None
        self._restart(self._sample - seen.shape[0])
        return self._demodulate(seen)

    def gap(self, samples_lost: int | None) -> None:
        """Note that samples were lost before the next block; None: number unknown."""
        self._sample += samples_lost or 0
        self._survey_counts = []
        if self._beats:
            self._restart(self._sample)
            self._waiting = None
            self._after_gap = True

    def _tune(self, seen: NDArray[np.int16]) -> None:
        measurement, reference = self._columns
        bits = self._setup.digitizer_bits
        beat = survey(seen[:, measurement], self._rate, bits, "measurement channel")
        rest_hz = self._setup.rest_frequency_hz
        tunings: list[tuple[int, Tuning, float, float]] = []
        if reference is not None:
            rest = survey(seen[:, reference], self._rate, bits, "reference channel")
            rest_hz = 0.5 * (rest.low_hz + rest.high_hz)
            tuning = tune(self._rate, rest_hz, rest_hz, _REST_HALF_WIDTH_HZ, _MIN_PHASE_RATE_HZ)
            tunings.append((reference, tuning, rest_hz, rest.offset_counts))
        assert rest_hz is not None
        reach = min(MAX_DOPPLER_HZ, 0.75 * rest_hz, 0.75 * (0.5 * self._rate - rest_hz))
        while True:
            low, high = min(beat.low_hz - 5e3, rest_hz - reach), max(beat.high_hz + 5e3, rest_hz + reach)
            centre, half_width = 0.5 * (low + high), 0.5 * (high - low)
            try:
                tuning = tune(self._rate, centre, centre, half_width, _MIN_PHASE_RATE_HZ)
                break
            except AnalysisError:
                if reach < 0.1 * rest_hz:
                    raise
                reach *= 0.85
        tunings.insert(0, (measurement, tuning, centre, beat.offset_counts))
        self._beats = [_BeatStream(*t, self._wanted_rate, self._bandwidth) for t in tunings]

    def _restart(self, sample: int) -> None:
        self._pd0_period_start = sample
        self._beats[0].restart(sample)  # PD0 restarts each time it is read

    def _demodulate(self, counts: NDArray[np.int16]) -> LiveChunk:
        line = self._beats[0]
        parts = line.feed(counts)
        if self._waiting is not None:
            parts = np.concatenate((self._waiting, parts), axis=1)
            self._waiting = None
        time_s, frequency, slope = parts
        if len(self._beats) > 1:
            self._read_pd0(counts)
        if self._rest_hz is None:
            self._waiting = parts
            return self._empty_chunk()
        if time_s.size == 0:
            return self._empty_chunk()
        velocity = -0.5 * self._wavelength * (frequency - self._rest_hz)
        force = -0.5 * self._wavelength * self._setup.moving_mass_kg * slope
        if self._after_gap:
            self._after_gap = False
            time_s = np.concatenate(([time_s[0] - 1 / line.rate_hz], time_s))
            frequency, velocity, force = (np.concatenate(([np.nan], part)) for part in (frequency, velocity, force))
        return LiveChunk(time_s, frequency, velocity, force, self._rest_hz, None)

    def _read_pd0(self, counts: NDArray[np.int16]) -> None:
        """Read PD0 in the first part of every period that ``counts``, which end at ``_sample``, overlap."""
        period, part = round(PD0_PERIOD_S * self._rate), round(PD0_READ_S * self._rate)
        first = at = self._sample - counts.shape[0]
        while at < self._sample:
            into = (at - self._pd0_period_start) % period
            if into == 0:
                self._beats[1].restart(at)
            stop = min(self._sample, at + (part if into < part else period) - into)
            if into < part:
                self._average_rest(self._beats[1].feed(counts[at - first : stop - first])[1])
            at = stop

    def _average_rest(self, rest: Floats) -> None:
        if rest.size == 0:
            return
        memory = REST_MEMORY_S * self._beats[1].rate_hz * PD0_READ_S / PD0_PERIOD_S
        weight = rest.size / (rest.size + min(self._rest_weight, memory))
        mean = float(rest.mean())
        self._rest_hz = mean if self._rest_hz is None else self._rest_hz + weight * (mean - self._rest_hz)
        self._rest_weight += rest.size

    def _empty_chunk(self) -> LiveChunk:
        empty = np.empty(0)
        return LiveChunk(empty, empty, empty, empty, self._rest_hz, self._problem)


class _BeatStream:
    """One beat of the stream: its decimated phase and the phase's derivatives."""

    def __init__(
        self, column: int, tuning: Tuning, centre_hz: float, offset: float, rate_hz: float, bandwidth_hz: float
    ) -> None:
        self._column = column
        self._tuning = tuning
        self._schedule = fixed_schedule(tuning, centre_hz)
        self._offset = offset
        self._group = _GROUP if tuning.phase_rate_hz > _MIN_GROUPS * _GROUP * rate_hz else 1
        self._factor = max(2, round(tuning.phase_rate_hz / (self._group * rate_hz)))
        self._step = self._group * self._factor * tuning.decimation  # input samples per output point
        self.rate_hz = tuning.sample_rate_hz / self._step
        self._filters = derivative_filters(self.rate_hz, min(bandwidth_hz, 0.35 * self.rate_hz))

    def restart(self, sample: int) -> None:
        self._reader = BeatReader(self._tuning, self._schedule, self._column, self._offset, sample)
        self._decimator = PhaseDecimator(self._factor)
        middle = self._reader.index + 0.5 * (self._group - 1)  # centre of the first group
        self._delay = middle * self._tuning.decimation + self._tuning.delay_samples
        self._first = 0  # index of the oldest phase kept
        self._phase = np.empty(0)

    def feed(self, counts: NDArray[np.int16]) -> Floats:
        """Return time in s, frequency in Hz and its rate of change in Hz/s as rows, shape (3, k)."""
        _, phase, power = self._reader.feed(counts)
        if self._group > 1:  # the reader returns whole batches, which are whole groups
            phase, power = group_means(phase, power, self._group)
        _, phase, _ = self._decimator.feed(phase, power)
        self._phase = np.concatenate((self._phase, phase))
        half = self._filters.half
        ready = self._phase.size - 2 * half
        if ready <= 0:
            return np.empty((3, 0))
        frequency = self._reader.oscillator_hz + filtered(self._phase, self._filters.velocity)
        slope = filtered(self._phase, self._filters.acceleration)
        index = self._first + half + np.arange(ready) + 6
        time_s = np.asarray((index * self._step + self._delay) / self._tuning.sample_rate_hz, np.float64)
        self._phase = self._phase[ready:].copy()
        self._first += ready
        return np.stack((time_s, frequency, slope))
