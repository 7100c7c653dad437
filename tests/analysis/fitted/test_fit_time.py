"""Every fit has a limit of time, and a record of impossible duration is refused before it."""

import threading
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest

from analysis.drive.regression import Regression, regress
from analysis.drive.stretch import Table
from analysis.fitted import fit_time
from analysis.fitted.fit_time import FitTime, run_with_time_limit
from analysis.fitted.fitted_shot import fit_jointly, fit_shot
from analysis.pipeline import analyse_motion
from analysis.shot.shot import AnalysisError, AnalysisSettings, Cancelled, Shot
from analysis.signal.record import motion_from_displacement
from tests.analysis.drive.slider import Drive
from tests.analysis.shots import shots_of
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_of


def shot_of(rate_hz: float, unit_s: float, settings: AnalysisSettings) -> Shot:
    """Return the analysis of a motion record whose times are in another unit than seconds."""
    sharp = motion_of(Synthetic(noise_m=1e-9, rate_hz=rate_hz, bandwidth_hz=0.2 * rate_hz))
    motion = motion_from_displacement(sharp.time_s / unit_s, sharp.displacement_m, None, None, MASS_KG)
    return analyse_motion(motion, settings, name="record")


def test_an_impossible_duration_is_refused_before_a_fit() -> None:
    shot = shot_of(1.7e3, 1e-6, AnalysisSettings())
    assert shot.problem == "time_s: 102 samples over 5.94e+04 s: is the unit right?"
    assert shot.fit is None and shot.seconds["fit"] < 0.1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shot = shot_of(2e3, 1e-3, AnalysisSettings(fit=False))  # a minute: strange, and not impossible
    assert shot.problem is None and shot.impact is not None


def test_a_fit_that_does_not_end_is_stopped_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shot_of(2e3, 1.0, AnalysisSettings()).fit is not None  # compiled from here on
    monkeypatch.setattr("analysis.reading.record_checks.LONGEST_S", 1e9)
    began = time.process_time()
    shot = shot_of(2e3, 1e-6, AnalysisSettings(fit_seconds=2.0))
    assert time.process_time() - began < 12.0
    ended = ("no end of the fit after 2 s", "no trajectory of the base model resembles this contact")
    assert shot.fit is None and str(shot.fit_problem).startswith(ended)
    assert "fit_failed" in shot.flags and shot.impact is not None


def test_the_fit_of_a_drive_has_a_limit_of_time_too(monkeypatch: pytest.MonkeyPatch) -> None:
    fits = []

    def endless(table: Table, _effects: tuple[str, ...]) -> Regression:
        for _ in range(30_000):  # more than half a minute
            fits.append(regress(table))
        return fits[-1]

    monkeypatch.setattr("analysis.drive.driven_fit.fit_accepted", endless)
    with pytest.raises(AnalysisError, match="no end of the fit after 1 s"):
        fit_jointly(shots_of([Drive().motion()]), "driven", (), seconds=1.0)
    time.sleep(0.2)
    done = len(fits)
    time.sleep(0.2)
    assert len(fits) == done  # nothing goes on behind


def test_a_cancelled_fit_ends_at_once() -> None:
    shot = shot_of(2e3, 1.0, AnalysisSettings(fit=False))
    with pytest.raises(Cancelled):
        fit_shot(replace(shot, settings=AnalysisSettings()), (), lambda: True)


def test_compiling_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    class Clock:
        """Stands for the time of the machine."""

        now, used = 100.0, 7.0

        def monotonic(self) -> float:
            return self.now

        def process_time(self) -> float:
            return self.used

        def passes(self, seconds: float) -> None:
            self.now += seconds
            self.used += seconds

    clock = Clock()
    monkeypatch.setattr(fit_time, "time", clock)
    counting = fit_time._compiling()
    left = FitTime(5.0)
    counting.on_start(None)
    clock.passes(60.0)
    assert not left()  # under way
    counting.on_start(None)  # what is compiled for it, and in another thread
    other = threading.Thread(target=counting.on_end, args=(None,))
    other.start()
    other.join()
    clock.passes(60.0)
    counting.on_end(None)
    clock.passes(4.0)
    assert not left() and not left.over
    for ahead in ("used", "now"):  # threads side by side, or others have the processor
        with monkeypatch.context() as patch:
            patch.setattr(clock, ahead, getattr(clock, ahead) + 900.0)
            assert not left()
    clock.passes(2.0)
    assert left() and left.over


def test_a_step_that_does_not_end_is_abandoned() -> None:
    ended = threading.Event()
    began = time.process_time()

    def endless() -> None:
        while not ended.is_set():
            time.monotonic()

    with pytest.raises(AnalysisError, match="no end of the fit after 1 s"):
        run_with_time_limit(endless, 1.0)
    ended.set()
    assert time.process_time() - began < 8.0
    assert run_with_time_limit(lambda: 7, 1.0) == 7
    with pytest.raises(ZeroDivisionError):
        run_with_time_limit(lambda: 1 // 0, 1.0)
    with pytest.raises(Cancelled):
        run_with_time_limit(lambda: time.sleep(5.0), 1.0, lambda: True)


def test_the_handling_of_overflows_is_passed_on() -> None:
    with np.errstate(over="raise"):
        assert run_with_time_limit(lambda: np.geterr()["over"], 1.0) == "raise"


def test_a_fit_has_a_second_at_least() -> None:
    assert FitTime(0.2).seconds == 1.0 and FitTime(3.0).seconds == 3.0
    assert FitTime(3.0).words.startswith("no end of the fit after 3 s")
