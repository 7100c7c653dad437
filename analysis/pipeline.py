"""Analyse one shot: demodulate, read, fit.  If a step fails, the shot states the reason.

``read`` stops after the readings, which need no model and so are available early at a first start; ``fitted`` adds the
fit.  Each step is imported where it is used, so that a window does not wait for the import.
"""

import time
from dataclasses import replace

from numpy.linalg import LinAlgError

from analysis.fitted import fit_shot, with_fit_pending
from analysis.shot import (
    SETUP_CORRECTED,
    AnalysisError,
    AnalysisSettings,
    Cancelled,
    ChannelsSwapped,
    Motion,
    NotSeen,
    Progress,
    Recording,
    Shot,
    Stop,
    corrected_setup,
)


def analyse(
    recording: Recording,
    settings: AnalysisSettings | None = None,
    *,
    load_seconds: float = 0.0,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Shot:
    """Analyse a raw recording.  Raises Cancelled; every other failure becomes the shot's ``problem``."""
    shot = read(recording, settings, load_seconds=load_seconds, progress=progress, cancelled=cancelled)
    return fitted(shot, progress=progress, cancelled=cancelled)


def read(
    recording: Recording,
    settings: AnalysisSettings | None = None,
    *,
    load_seconds: float = 0.0,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Shot:
    """Analyse a raw recording up to its readings; if a fit is wanted, the shot is flagged as awaiting it.

    Raises Cancelled; every other failure becomes the shot's ``problem``.
    """
    from analysis.signal import demodulate

    settings = settings or AnalysisSettings()
    if settings.corrections:
        setup = corrected_setup(recording.setup, dict(settings.corrections))
        recording = replace(recording, setup=setup, flags=_merged(recording.flags, (SETUP_CORRECTED,)))
    seconds = {"load": load_seconds}
    started = time.perf_counter()
    motion: Motion | None = None
    problem: AnalysisError | None = None
    try:
        motion = demodulate(recording, settings, progress, cancelled)
    except AnalysisError as error:
        problem = error
    seconds["demodulate"] = time.perf_counter() - started
    shot = Shot(
        name=recording.name,
        path=recording.path,
        settings=settings,
        setup=recording.setup,
        sample_rate_hz=recording.sample_rate_hz,
        samples=recording.samples,
        trigger_time_s=recording.trigger_time_s,
        motion=motion,
        impact=None,
        fit=None,
        flags=_merged(recording.flags, motion.flags if motion else ()),
        problem=None if problem is None else str(problem),
        channels_swapped=isinstance(problem, ChannelsSwapped),
        started_at=recording.started_at,
        note=recording.note,
        seconds=seconds,
    )
    return _impact_read(shot, progress, cancelled)


def analyse_motion(
    motion: Motion,
    settings: AnalysisSettings,
    *,
    name: str,
    path: str | None = None,
    load_seconds: float = 0.0,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Shot:
    """Analyse a motion record that another instrument has demodulated."""
    shot = Shot(
        name=name,
        path=path,
        settings=settings,
        setup=None,
        sample_rate_hz=motion.sample_rate_hz,
        samples=int(motion.time_s.size),
        trigger_time_s=motion.trigger_time_s,
        motion=motion,
        impact=None,
        fit=None,
        flags=motion.flags,
        seconds={"load": load_seconds, "demodulate": 0.0},
    )
    return fitted(_impact_read(shot, progress, cancelled), progress=progress, cancelled=cancelled)


def fitted(shot: Shot, *, progress: Progress | None = None, cancelled: Stop | None = None) -> Shot:
    """Return a shot from ``read`` with its fit added; unchanged if no fit is wanted.  Raises Cancelled."""
    if shot.motion is None:
        return shot
    _tell(progress, cancelled, "fitting the model", 0.6)
    started = time.perf_counter()
    shot = fit_shot(shot, shot.settings.effects, cancelled)
    _tell(progress, cancelled, "done", 1.0)
    return replace(shot, seconds={**shot.seconds, "fit": time.perf_counter() - started})


def _impact_read(shot: Shot, progress: Progress | None, cancelled: Stop | None) -> Shot:
    if shot.motion is None:
        return shot
    from analysis.reading import NoImpact, check_collision, describe_motion, describe_reversal, read_impact
    from analysis.shot import with_rate_error
    from analysis.signal import CROSS_TALK_LEFT as CROSS_TALK

    _tell(progress, cancelled, "reading the impact", 0.5)
    started = time.perf_counter()
    motion = shot.motion
    if shot.settings.collides:
        try:
            check_collision(motion)
            impact = with_rate_error(read_impact(motion), motion)
            if CROSS_TALK in motion.flags:
                unsure = NotSeen("cross-talk of PD1 in PD0 could not be removed: fringes may be lost or gained")
                impact = replace(impact, deflection_max_m=unsure)
            shot = replace(shot, impact=impact, flags=_merged(shot.flags, impact.flags))
        except (NoImpact, AnalysisError) as error:
            shot = replace(shot, problem=describe_reversal(motion) or f"{error}{describe_motion(motion)}")
        except (LinAlgError, ValueError, IndexError, ZeroDivisionError):
            shot = replace(shot, problem="the motion is in too many pieces, or too torn, to be read as one collision")
    shot = replace(shot, seconds={**shot.seconds, "impact": time.perf_counter() - started})
    return with_fit_pending(shot)


def _tell(progress: Progress | None, cancelled: Stop | None, what: str, fraction: float) -> None:
    if cancelled is not None and cancelled():
        raise Cancelled
    if progress is not None:
        progress(what, fraction)


def _merged(*groups: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(flag for group in groups for flag in group))
