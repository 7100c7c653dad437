"""Read the vibration of the site from a block at rest: spectrum against vibration criteria, lines, reachable u(COR).

The criterion curves (Gordon, "Generic criteria for vibration-sensitive equipment", SPIE 1619, 1991) state the rms
velocity in every third-octave from 8 to 80 Hz.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Floats

CRITERIA_M_PER_S: Mapping[str, float] = {
    "VC-G": 0.78e-6,
    "VC-F": 1.56e-6,
    "VC-E": 3.12e-6,
    "VC-D": 6.25e-6,
    "VC-C": 12.5e-6,
    "VC-B": 25e-6,
    "VC-A": 50e-6,
    "ISO operating theatre": 100e-6,
    "ISO residence": 200e-6,
    "ISO office": 400e-6,
    "ISO workshop": 800e-6,
}
BAND_HZ = (8.0, 80.0)  # of the criteria
CENTRES_HZ = 10 ** (np.arange(6, 27) / 10)  # of third-octaves, 4 to 400 Hz
_OF_CRITERIA = (0.97 * BAND_HZ[0] < CENTRES_HZ) & (1.03 * BAND_HZ[1] > CENTRES_HZ)
MIN_S = 1.0  # shortest record: a third-octave at 8 Hz then has two bins
_MAX_LINES = 10
_LINE = 25.0  # least power of a line over that of its surroundings; e^-25 by chance in each bin
_ABOUT = 9  # bins to each side of a line that are its surroundings
_MAX_STEPS = 160  # time steps of both flights together, for the covariance
_CHANCE = 0.05  # probability that a site exactly on a criterion's curve is rated the next worse
_HAND_LINE = 12.0  # the same for lines at 7 to 12.5 Hz, a hand's tremor
_HAND_HZ = (7.0, 12.5)  # tremor of a hand that holds the block, absent in a shot
_UNSURE = 0.5  # uncertainty of a line's frequency in a flight, in units of 1 / span; motors also vary
_COSTLY = 1.2  # least cost of a line that is reported


@dataclass(frozen=True, slots=True)
class MachineLine:
    """A steady sine; ``cost`` is the factor by which it raises the expected u(COR)."""

    frequency_hz: float
    amplitude_m: float
    cause: str
    cost: float = 1.0


@dataclass(frozen=True, slots=True)
class PlannedShot:
    """The expected shot: speed (m/s), restitution, and the durations of its flights and its contact (s)."""

    speed_m_per_s: float = 0.265
    restitution: float = 0.9876
    before_s: float = 0.01
    contact_s: float = 0.0287
    after_s: float = 0.02


@dataclass(frozen=True, slots=True)
class SiteFloor:
    """The vibration of the site's floor; arrays of shape (k,) are read-only.

    ``third_octave_m_per_s`` includes the lines; ``density_m2_per_hz`` (one-sided, of displacement, at ``frequency_hz``)
    does not.  ``criterion`` is the strictest that no band exceeds significantly, given the record's length (5 % chance
    for all bands together); "" if all are exceeded.
    """

    seconds: float
    centre_hz: Floats
    third_octave_m_per_s: Floats
    frequency_hz: Floats
    density_m2_per_hz: Floats
    lines: tuple[MachineLine, ...]
    criterion: str
    cor_std: float

    @property
    def advice(self) -> tuple[str, ...]:
        """Get one sentence per costly line, worst first."""
        costly = sorted((line for line in self.lines if line.cost >= _COSTLY), key=lambda line: -line.cost)
        return tuple(
            f"{line.cause[0].upper()}{line.cause[1:]} at {line.frequency_hz:.1f} Hz costs you a factor "
            f"{line.cost:.1f} in the uncertainty of the restitution"
            for line in costly
        )


def read_site(velocity_m_per_s: Floats, sample_rate_hz: float, planned: PlannedShot | None = None) -> SiteFloor | None:
    """Return the floor's vibration from the velocity of a block at rest, shape (n,), without gaps.

    None if it is shorter than MIN_S or not finite.  Cost: about 5 ms for four seconds, and 3 ms per line.
    """
    n = velocity_m_per_s.size
    if n < MIN_S * sample_rate_hz or not np.isfinite(velocity_m_per_s).all():
        return None
    time_s = np.arange(n) / sample_rate_hz
    rest = velocity_m_per_s - np.polyval(np.polyfit(time_s, velocity_m_per_s, 1), time_s)
    waves: list[tuple[float, float]] = []  # frequency, amplitude of velocity
    while len(waves) < _MAX_LINES:
        found = _strongest_line(rest, sample_rate_hz)
        if found is None:
            break
        frequency, wave = _refined(rest, time_s, found)
        rest = rest - wave
        waves.append((frequency, float(np.sqrt(2 * np.mean(wave**2)))))
    frequency_hz, power = _periodogram(rest, sample_rate_hz)
    density = _smoothed(power) / (2 * np.pi * frequency_hz) ** 2
    lines = tuple(
        MachineLine(frequency, speed / (2 * np.pi * frequency), likely_cause(frequency, 0.3 * sample_rate_hz / n))
        for frequency, speed in sorted(waves)
    )
    bands, least = _third_octaves(frequency_hz, power, [wave for wave in waves if not _of_hand(wave[0])])
    for array in (bands, frequency_hz, density):
        array.flags.writeable = False
    floor = SiteFloor(n / sample_rate_hz, CENTRES_HZ, bands, frequency_hz, density, lines, _criterion(least), 0.0)
    stay = [line for line in lines if not _of_hand(line.frequency_hz)]
    cor_std, without = PlannedFlights.on(floor, planned or PlannedShot()).cor_stds(stay)
    costs = {line: cor_std / less for line, less in zip(stay, without, strict=True)}
    return replace(floor, lines=tuple(replace(line, cost=costs.get(line, 1.0)) for line in lines), cor_std=cor_std)


def likely_cause(frequency_hz: float, resolution_hz: float) -> str:
    """Return the most probable cause of a line: mains or a multiple, a motor on the mains, a hand, or a general one."""
    near = max(0.05, resolution_hz)
    for mains in (50.0, 60.0):
        order = round(frequency_hz / mains)
        if order >= 1 and abs(frequency_hz - order * mains) < near * (1 + 0.2 * order):
            if order == 1:
                return f"the mains ({mains:g} Hz)"
            return "a transformer or a lamp (twice the mains)" if order == 2 else f"the mains ({order} x {mains:g} Hz)"
    for mains in (50.0, 60.0):
        for pairs in (1, 2, 3):  # an induction motor runs up to about 7 % slower than its field
            if 0.93 * mains / pairs <= frequency_hz <= mains / pairs + near:
                return f"a motor or pump ({2 * pairs} poles on {mains:g} Hz)"
    if _of_hand(frequency_hz):
        return "the hand that holds the block"
    return "the building or a table on its legs" if frequency_hz < _HAND_HZ[0] else "a fan or a resonance"


@dataclass(frozen=True, slots=True)
class PlannedFlights:
    """Two straight flights at time steps, shape (n,), and their covariance on a floor without lines, (n, n) in m^2.

    The covariance is the slowest part to compute and does not depend on the lines.
    """

    planned: PlannedShot
    span_s: float
    time_s: Floats
    design: Floats  # (n, 4)
    covariance_m2: Floats

    @classmethod
    def on(cls, floor: SiteFloor, planned: PlannedShot) -> "PlannedFlights":
        """Return the flights of a planned shot on this floor.  Cost: about 2 ms."""
        span = planned.before_s + planned.contact_s + planned.after_s
        step = max(5e-4, (planned.before_s + planned.after_s) / _MAX_STEPS)
        time_s = np.arange(0.5 * step, span, step)
        before, after = time_s < planned.before_s, time_s > planned.before_s + planned.contact_s
        keep = before | after
        index = np.flatnonzero(keep)
        covariance = _covariance(floor, step, time_s.size)[np.abs(index[:, None] - index[None, :])]
        columns = (before, before * (time_s - planned.before_s), after, after * (time_s - span + planned.after_s))
        design = np.stack(columns, axis=1)[keep].astype(np.float64)
        return cls(planned, span, time_s[keep], design, covariance)

    def cor_stds(self, lines: Sequence[MachineLine]) -> tuple[float, list[float]]:
        """Return u(COR) with these lines, of unknown phase and frequency, and with each of them left out, in order.

        By generalised least squares.  A line adds four columns to the covariance, so one solution without lines
        suffices for every set of lines (Woodbury's identity).  About 2 ms.
        """
        columns = [self.design]
        for line in lines:
            angle = 2 * np.pi * line.frequency_hz * self.time_s
            wave = np.stack((np.cos(angle), np.sin(angle)), axis=1)
            bend = 2 * np.pi * (_UNSURE / self.span_s) * (self.time_s - 0.5 * self.span_s)[:, None] * wave
            columns.append(line.amplitude_m / math.sqrt(2.0) * np.concatenate((wave, bend), axis=1))
        both = np.concatenate(columns, axis=1)
        products = both.T @ np.linalg.solve(self.covariance_m2, both)
        flights = self.design.shape[1]
        ratio = np.array([0.0, self.planned.restitution, 0.0, 1.0]) / self.planned.speed_m_per_s

        def std(of: NDArray[np.int64]) -> float:
            own, shared = products[:flights, :flights], products[:flights, of]
            left = own - shared @ np.linalg.solve(np.eye(of.size) + products[np.ix_(of, of)], shared.T)
            return float(np.sqrt(ratio @ np.linalg.solve(left, ratio)))

        every = np.arange(flights, both.shape[1])
        of_line = (every - flights) // 4
        return std(every), [std(every[of_line != k]) for k in range(len(lines))]


def _of_hand(frequency_hz: float) -> bool:
    return _HAND_HZ[0] <= frequency_hz <= _HAND_HZ[1]


def _covariance(floor: SiteFloor, step_s: float, count: int) -> Floats:
    """Return the covariance of step means of the displacement at lags of 0, 1, ... steps, (count,)."""
    frequency, density = floor.frequency_hz, floor.density_m2_per_hz
    seen = density * np.sinc(frequency * step_s) ** 2
    width = float(frequency[1] - frequency[0])
    # motion near zero frequency is constant in a shot, and absorbed by the flights' offsets
    turn, wave = np.exp(2j * np.pi * step_s * frequency), np.ones(frequency.size, dtype=np.complex128)
    covariance = np.empty(count)
    for lag in range(count):
        covariance[lag] = width * (seen @ wave.real)
        wave *= turn
    covariance[0] += 1e-6 * covariance[0]
    return covariance


def _periodogram(values: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Return frequencies above zero and the one-sided density through a Hann window."""
    window = np.sin(np.pi * (np.arange(values.size) + 0.5) / values.size) ** 2
    power = 2 * np.abs(np.fft.rfft(values * window)) ** 2 / (rate_hz * np.sum(window**2))
    return np.asarray(np.fft.rfftfreq(values.size, 1 / rate_hz), dtype=np.float64)[1:], power[1:]


def _smoothed(power: Floats) -> Floats:
    """Return the density averaged over a tenth of its frequency on each side."""
    total = np.concatenate(([0.0], np.cumsum(power)))
    index = np.arange(1, power.size + 1)
    half = np.maximum(1, np.rint(0.1 * index).astype(np.int64))
    low, high = np.maximum(index - 1 - half, 0), np.minimum(index + half, power.size)
    return np.asarray((total[high] - total[low]) / (high - low))


def _strongest_line(values: Floats, rate_hz: float) -> float | None:
    """Return the frequency of the line with the most power relative to its surroundings; None if not significant."""
    frequency, power = _periodogram(values, rate_hz)
    padded = np.pad(power, _ABOUT, mode="reflect")
    sides = np.lib.stride_tricks.sliding_window_view(padded, 2 * _ABOUT + 1)
    # each side separately: a steep edge of the spectrum is not a line
    about = np.maximum(np.median(sides[:, : _ABOUT - 2], 1), np.median(sides[:, _ABOUT + 3 :], 1)) / math.log(2.0)
    inside = (frequency > 3.0 * frequency[0]) & (frequency < 0.4 * rate_hz)
    needed = np.where((frequency >= _HAND_HZ[0]) & (frequency <= _HAND_HZ[1]), _HAND_LINE, _LINE)
    excess = np.where(inside, power / np.maximum(about, 1e-300), 0.0) / needed
    best = int(np.argmax(excess))
    if excess[best] < 1.0 or not 0 < best < power.size - 1:
        return None
    left, middle, right = np.log(power[best - 1 : best + 2])
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(frequency[best] + shift * frequency[0])


def _refined(values: Floats, time_s: Floats, frequency_hz: float) -> tuple[float, Floats]:
    """Return the frequency (Gauss-Newton) and the sine itself, by least squares through a Hann window."""
    window = np.sin(np.pi * (np.arange(values.size) + 0.5) / values.size) ** 2
    turn = 2 * np.pi * (time_s - time_s.mean())

    def fitted() -> tuple[Floats, Floats]:
        """Return the sine of this frequency and its derivative by frequency."""
        cosine, sine = np.cos(frequency_hz * turn), np.sin(frequency_hz * turn)
        both = np.stack((cosine, sine)) * window
        c, s = np.linalg.solve(both @ both.T, both @ (values * window))
        return c * cosine + s * sine, turn * (s * cosine - c * sine)

    for _ in range(4):
        wave, bend = fitted()
        bend = bend * window
        frequency_hz += float((values - wave) * window @ bend / max(float(bend @ bend), 1e-300))
    return frequency_hz, fitted()[0]


def _third_octaves(frequency_hz: Floats, power: Floats, waves: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    """Return the rms in each third-octave, lines included, and its lower limit given its scatter, (k,) each.

    A band of a few bins scatters: for a site exactly on a criterion's curve the largest of eleven measured bands is
    nearly always above it.
    """
    found, least = np.zeros(CENTRES_HZ.size), np.zeros(CENTRES_HZ.size)
    for k, centre in enumerate(CENTRES_HZ):
        low, high = centre * 10**-0.05, centre * 10**0.05
        inside = (frequency_hz >= low) & (frequency_hz < high)
        mean = power[inside].mean() if inside.any() else float(np.interp(centre, frequency_hz, power))
        random = mean * (high - low)
        lines = sum(0.5 * speed**2 for frequency, speed in waves if low <= frequency < high)
        found[k] = random + lines
        least[k] = random / _most_by_chance(max(int(inside.sum()), 1)) + lines
    return np.sqrt(found), np.sqrt(least)


def _most_by_chance(bins: int) -> float:
    """Return the ratio of a band's measured to true power that any band exceeds with probability ``_CHANCE``.

    Neighbouring bins of a Hann window share 4/9 of their power, next neighbours 1/36.
    """
    from scipy.special import chdtri  # imported late: it takes 0.2 s, which would delay the opening of the window

    freedom = 2 * bins / (1 + 2 * (1 - 1 / bins) * 4 / 9 + 2 * max(0.0, 1 - 2 / bins) / 36)
    return float(chdtri(freedom, _CHANCE / np.count_nonzero(_OF_CRITERIA))) / freedom


def _criterion(bands: Floats) -> str:
    worst = float(bands[_OF_CRITERIA].max())
    return next((name for name, level in CRITERIA_M_PER_S.items() if worst <= level), "")
