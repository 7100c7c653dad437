"""Test whether residuals are noise; if not, describe their phases, speed dependence and spectral line."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from analysis.collision import Effect
from analysis.diagnosis.evidence.lack_of_fit import (
    NO_MISFIT,
    LackOfFit,
    gain,
    hats,
    largest_misfit,
    low_frequency_excess,
    shared,
)
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Errors, Phase, Remainder
from analysis.inference import Fitted, Floor, Linearised, Samples
from analysis.shot import Floats, Motion
from analysis.signal import derivatives

_CONTACT = np.array([0.0, 0.03, 0.07, 0.12, 0.2, 0.32, 0.46, 0.6, 0.75, 0.9, 1.0])  # knots, in contact times
_POWERS = (0, 1, 2)
_LINE, _SLOWEST = 12.0, 3  # least power of a line over the median power; its least number of periods within a shot


@dataclass(frozen=True, slots=True)
class Residual:
    """The tests of a residual; ``coherence`` is the likelihood ratio of a shape shared by all shots.

    ``limit`` is the limit of that ratio by chance.  ``correlation`` is the whitened residual's largest autocorrelation,
    ``ratio`` its power in the loudest phase over that in the quietest.  ``samples`` is the number of samples tested.
    """

    coherence: float
    limit: float
    correlation: float
    ratio: float
    size: float = 0.0  # of a significant shared shape, in units of the noise
    misfit: LackOfFit = NO_MISFIT  # the freedom that the hypothesis misses most; a correct one misses none
    samples: int = 1

    @property
    def unexplained_norms(self) -> float:
        """Get the size of the significant part, shared shape or misfit, in units of the noise."""
        return max(self.size, self.misfit.size if self.misfit.significant else 0.0)

    @property
    def rough(self) -> bool:
        """Get whether the residual is so unlike noise that no likelihood can be trusted."""
        return self.correlation > CRITERIA.rough_correlation or self.ratio > CRITERIA.rough_ratio

    @property
    def significant(self) -> bool:
        """Get whether the residual is more than noise."""
        return self.rough or self.coherence > self.limit or self.misfit.significant

    @property
    def faint(self) -> bool:
        """Get whether all that is missed is a freedom so small that noise alone may look like it.

        Its chi^2 is below sqrt(2 n), the scatter of chi^2 of n samples, and below the least that a law must explain to
        be learned.  White noise looks like that in three of a thousand fits; a search for laws would be useless.
        """
        if not self.misfit.significant or self.rough or self.coherence > self.limit:
            return False
        least_of_a_law = CRITERIA.law_fall + math.log(self.samples)
        return self.misfit.size**2 < min(math.sqrt(2.0 * self.samples), least_of_a_law)

    def leaves_something(self, *, nothing_pays: bool) -> bool:
        """Return whether the residual must be explained: it exceeds noise, and is no faint trace without an effect.

        ``nothing_pays``: the fit has no effect, and none that was tried explains enough to join.
        """
        return self.significant and not (nothing_pays and self.faint)


def residual_of(fitted: Fitted, at: Linearised) -> Residual:
    """Test the residual of a fit.

    On a moving frame, strengths learned from the residual have absorbed much of a missing law.  Free laws and shared
    shapes are therefore tested under the noise of the flights.  Its strengths are uncertain, so chance gains more.
    """
    shots = fitted.problem.data.shots
    on_frame = fitted.problem.data.site.moves
    unlearned = at.under(fitted.unlearned_noise) if on_frame else at
    white = fitted.whitened()
    correlation = _correlation(white)
    ratio = _ratio(white, shots)
    slow = low_frequency_excess(white)
    coherence, limit, width = _coherence(fitted, unlearned) if len(shots) > 1 else (0.0, math.inf, 0)
    limit *= slow * (CRITERIA.wandering_gain if on_frame else 1.0)
    size = math.sqrt(max(0.0, coherence - width)) if coherence > limit else 0.0
    samples = sum(part.size for part in white)
    return Residual(coherence, limit, correlation, ratio, size, largest_misfit(fitted, at, unlearned, slow), samples)


def _correlation(white: Sequence[Floats]) -> float:
    """Return the largest autocorrelation at lags of 1 to 20 samples (pooled over the shots).

    The first three lags count half, since an optics filter correlates neighbouring samples only.
    """
    power = sum(float(w @ w) for w in white)
    out = 0.0
    for lag in range(1, 21):
        value = abs(sum(float(w[lag:] @ w[:-lag]) for w in white if w.size > lag)) / power
        out = max(out, 0.5 * value if lag <= 3 else value)
    return out


def _phase_of(shot: Samples) -> list[tuple[Phase, NDArray[np.bool_]]]:
    """Return the phases of a shot with the samples in each."""
    t = shot.centre_s
    c = shot.course
    bounce = c.touch_time_s + 0.2 * c.contact_time_s
    release = c.release_time_s
    edge = 0.08 * c.contact_time_s
    bounds = [-np.inf, c.touch_time_s, bounce, c.turnaround_time_s, release - edge, release + edge, np.inf]
    return [(n, (t >= a) & (t < b) & shot.valid) for n, a, b in zip(Phase, bounds[:-1], bounds[1:], strict=True)]


def _ratio(white: Sequence[Floats], shots: Sequence[Samples]) -> float:
    power: dict[Phase, list[Floats]] = {}
    for w, shot in zip(white, shots, strict=True):
        for name, here in _phase_of(shot):
            part = w[here[shot.valid]]
            if part.size > 40:
                power.setdefault(name, []).append(part)
    means = [float(np.mean(np.concatenate(parts) ** 2)) for parts in power.values()]
    return max(means) / max(min(means), 1e-12) if means else 1.0


def _coherence(fitted: Fitted, at: Linearised) -> tuple[float, float, int]:
    """Return the largest likelihood ratio of a residual shape shared by all shots, its limit, and its parameter count.

    The shape is free (bumps over the time since touch); its size scales as the speed to the power 0, 1 or 2.
    """
    shots = fitted.problem.data.shots
    fastest = max(abs(s.course.velocity_in_m_per_s) for s in shots)
    bumps = [_bumps(shot) for shot in shots]

    def gained(power: int) -> tuple[float, int, Floor]:
        parts = zip(bumps, shots, strict=True)
        columns = [bump * (abs(shot.course.velocity_in_m_per_s) / fastest) ** power for bump, shot in parts]
        return gain(fitted, at, shared(columns))

    gains = [gained(power) for power in _POWERS]
    best = max(0.0, *(value for value, _, _ in gains))
    width = gains[-1][1]
    limit = CRITERIA.small_sample * float(chdtri(width, CRITERIA.shape_chance / len(_POWERS)))
    return best, limit, width


def _bumps(shot: Samples) -> Floats:
    """Return raised-cosine bumps over the time since touch, shape (n, k): 2 before, 11 in contact, 3 after."""
    c = shot.course
    length = c.contact_time_s
    before = np.linspace(shot.centre_s[0] - c.touch_time_s, 0.0, 3)[:-1] / length
    after = 1.0 + np.linspace(0.0, (shot.centre_s[-1] - c.touch_time_s) / length - 1.0, 4)[1:]
    knots = np.concatenate([before, _CONTACT, after])
    u = (shot.centre_s - c.touch_time_s) / length
    return 0.5 - 0.5 * np.cos(np.pi * hats(u, knots))


def remainder_of(fitted: Fitted, misfit: LackOfFit = NO_MISFIT, imitated_by: Sequence[Effect] = ()) -> Remainder:
    """Describe the residual of a fit: its loudest phases, its scaling with speed, and its strongest line.

    Sizes are above the sensor's white noise (nearly all of a camera's residual), with the frame's most likely motion
    subtracted.  ``misfit`` is of the model with the effects that imitate the residual, where there are any.
    """
    shots = fitted.problem.data.shots
    noise_m = fitted.noise.white_m
    square: dict[Phase, list[float]] = {}
    above, speeds = [], []
    for shot, left_m in zip(shots, fitted.residual_m, strict=True):
        residual = shot.without_frame_motion(fitted.noise, left_m)
        white = (noise_m * shot.weight) ** 2
        above.append(float(np.mean(residual[shot.valid] ** 2)) - white)
        speeds.append(abs(shot.course.velocity_in_m_per_s))
        for phase, here in _phase_of(shot):
            if here.sum() > 5:
                square.setdefault(phase, []).append(float(np.mean(residual[here] ** 2)) - white)
    rms = {phase: _root(values) for phase, values in square.items()}
    loud = sorted((phase for phase in rms if rms[phase] > 0.0), key=lambda phase: -rms[phase])
    power = None
    if len(shots) > 1 and max(speeds) / min(speeds) > 1.15 and min(above) > 0.0:
        power = float(np.polyfit(np.log(speeds), 0.5 * np.log(above), 1)[0])
    used, norms = (misfit.shape, misfit.size) if misfit.significant else (None, 0.0)
    loudest = tuple((phase, rms[phase]) for phase in loud[:3])
    return Remainder(_root(above), noise_m, loudest, power, _line(fitted), used, norms, tuple(imitated_by))


def _root(squares: Sequence[float]) -> float:
    """Return the root of the mean of squares from which a noise's was subtracted; 0 where that is negative."""
    return math.sqrt(max(0.0, float(np.mean(squares))))


def _line(fitted: Fitted) -> float | None:
    """Return the frequency of a line that stands out of the whitened residual of all shots, or None.

    In one shot, the strongest of two thousand frequencies of white noise has eleven times their median power.
    """
    shots = fitted.problem.data.shots
    size = min(int(s.valid.sum()) for s in shots)
    spectra = [np.abs(np.fft.rfft(white[:size] * np.hanning(size))) ** 2 for white in fitted.whitened()]
    total = np.sum(spectra, axis=0)[_SLOWEST:]
    peak = int(np.argmax(total))
    by_chance = chdtri(2 * len(shots), CRITERIA.shape_chance / total.size) / chdtri(2 * len(shots), 0.5)
    if total[peak] < max(_LINE, float(by_chance)) * float(np.median(total)):
        return None
    return float((_SLOWEST + peak) / (size * shots[0].spacing_s))


def errors(
    motions: Sequence[Motion],
    shots: Sequence[Samples],
    displacement_m: Sequence[Floats],
    floor: Floor,
    parameters: int,
) -> Errors:
    """Return the errors of modelled displacements (one per shot, on the motion's grid), pooled over the shots.

    Displacement is compared at the motion's own rate; velocity and force through the motion's own filters, the same
    for model and measurement.  ``reduced_chi2`` is whitened by ``floor`` (pass the same one before and after), over
    samples less ``parameters``.
    """
    sums, counts = np.zeros(3), np.zeros(3)
    chi2, samples = 0.0, 0
    for motion, shot, model in zip(motions, shots, displacement_m, strict=True):
        velocity, acceleration = derivatives(model, motion.sample_rate_hz, motion.bandwidth_hz)
        left = (
            motion.displacement_m - model,
            motion.velocity_m_per_s - velocity,
            motion.moving_mass_kg * (motion.acceleration_m_per_s2 - acceleration),
        )
        for k, values in enumerate(left):
            good = values[shot.used & np.isfinite(values)]
            sums[k] += float(good @ good)
            counts[k] += good.size
        rest = shot.left_m(shot.averaged(model))[:, None]
        white = shot.whitened(floor, rest)
        chi2 += float(np.sum(white**2))
        samples += white.size
    rms = np.sqrt(sums / np.maximum(counts, 1))
    return Errors(float(rms[0]), float(rms[1]), float(rms[2]), chi2 / max(1, samples - parameters))
