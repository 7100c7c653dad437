"""Check that a motion record can be a collision: units, mass, direction."""

import numpy as np

from analysis.shot import AnalysisError, Floats, Motion

CLEAR_SIGMAS = 20.0  # least height of a turn, in noise of the displacement
SHORTEST_S, LONGEST_S = 1e-6, 600.0  # limits of the duration of a record with a collision and its two flights
AT_REST_M = 1e-4  # movement in a whole record below which the block is at rest, even in a vibrating building
_BLOCKS = 200  # number of blocks into which a record is averaged, so that noise causes no turns


def check_collision(motion: Motion) -> None:
    """Raise AnalysisError with the cause if a foreign record lacks a mass or has a wrong sign or unit."""
    if motion.wavelength_m is not None:
        return
    span = float(motion.time_s[-1] - motion.time_s[0])
    if not SHORTEST_S <= span <= LONGEST_S:
        raise AnalysisError(f"time_s: {motion.time_s.size} samples over {span:.3g} s: is the unit right?")
    if not np.isfinite(motion.moving_mass_kg):
        raise AnalysisError(
            "moving_mass_kg: not stated; the force of a collision is mass times acceleration (say it in the .toml)"
        )
    if _reversed(motion.displacement_m, float(np.nanmedian(motion.displacement_std_m))):
        raise AnalysisError(
            "displacement_m: rises towards its turn and falls away from it; it has to fall towards the contact: "
            "reverse its sign"
        )


def _reversed(displacement_m: Floats, noise_m: float) -> bool:
    """Return whether the turn of a displacement, shape (n,), is a maximum instead of a minimum."""
    rough, _ = _means(displacement_m)
    top, bottom = int(np.argmax(rough)), int(np.argmin(rough))
    ends = rough[0], rough[-1]
    inside = 0 < top < rough.size - 1 and bottom in (0, rough.size - 1)
    far = rough[top] - max(ends) > max(CLEAR_SIGMAS * noise_m, 0.05 * float(np.ptp(rough)))
    return bool(inside and far)


def describe_reversal(motion: Motion) -> str | None:
    """Return in words whether time or direction is reversed in a motion from the optics; None if neither is.

    A plate returns less energy than it absorbs, so the slower of the two flights is the later one.
    """
    displacement = motion.displacement_m
    known = np.flatnonzero(np.isfinite(displacement))
    if motion.wavelength_m is None or known.size < _BLOCKS:
        return None
    if not _reversed(displacement, float(np.nanmedian(motion.displacement_std_m))):
        return None
    top = int(known[np.argmax(displacement[known])])
    away = _speed(displacement[known[0] : top], motion.sample_rate_hz)
    back = _speed(displacement[top : known[-1] + 1], motion.sample_rate_hz)
    if back > away:
        return "the block goes away first and comes back faster than it went: time runs backwards in this recording"
    rule = "PD1's beat has to lie above PD0's while it comes to the plate"
    return f"the block goes away first and comes back: the sense is reversed ({rule})"


def describe_motion(motion: Motion) -> str:
    """Return in words the block's motion in a record without a collision, and what to change; "" if unclear."""
    known = motion.displacement_m[np.isfinite(motion.displacement_m)]
    if motion.wavelength_m is None or known.size < _BLOCKS:
        return ""
    if float(np.ptp(known)) < AT_REST_M:
        return "; the block stands still throughout"
    rough = known[: known.size // _BLOCKS * _BLOCKS].reshape(_BLOCKS, -1).mean(axis=1)
    at = f"at {_speed(known, motion.sample_rate_hz):.2g} m/s"
    if np.all(np.diff(rough) > 0.0):
        return (
            f"; the block leaves the plate throughout, {at}: the switch triggered on its way back "
            "(arm before it is pushed, or choose the edge at which it comes)"
        )
    if np.all(np.diff(rough) < 0.0):
        return f"; the block comes to the plate throughout, {at}: the record ends before they touch (record longer)"
    return ""


def _speed(displacement_m: Floats, rate_hz: float) -> float:
    """Return the flight's speed in m/s in a stretch that also contains the slower contact."""
    means, size = _means(displacement_m)
    return float(np.percentile(np.abs(np.diff(means)), 90)) * rate_hz / size if means.size > 1 else 0.0


def _means(displacement_m: Floats) -> tuple[Floats, int]:
    """Return the means of some ``_BLOCKS`` blocks of the known samples, and the number of samples of a block."""
    known = displacement_m[np.isfinite(displacement_m)]
    size = max(1, known.size // _BLOCKS)
    return known[: known.size // size * size].reshape(-1, size).mean(axis=1), size
