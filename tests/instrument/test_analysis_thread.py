"""A shot's readings are reported before its fit, and a failed fit does not lose them."""

import threading

import pytest

from analysis.fitted.fitted_shot import fit_pending
from analysis.pipeline import analyse, fitted, read
from analysis.shot.shot import AnalysisError, AnalysisSettings, Cancelled
from instrument.capture.analysis_thread import AnalysisThread, ShotAnalysis, fit_here
from tests.beats import Synthetic, recording_of

LONGEST_S = 60.0


@pytest.fixture(scope="module")
def recording():
    return recording_of(Synthetic(duration_s=0.06))


@pytest.fixture
def told():
    return []


@pytest.fixture
def analyst(told):
    """Return a function that starts an analyst whose fit is the one given, with the event of its last word."""
    started = []

    def begin(fit):
        ended = threading.Event()

        def done(key, shot, problem):
            told.append((key, shot, problem))
            if shot is None or not fit_pending(shot):
                ended.set()

        begun = AnalysisThread(ShotAnalysis(lambda recording, progress, cancelled: read(recording), fit, 4), done)
        begun.start()
        started.append(begun)
        return begun, ended

    yield begin
    assert all(begun.close(LONGEST_S) for begun in started)


def test_the_two_steps_give_what_the_whole_road_gives(recording):
    first = read(recording)
    assert fit_pending(first) and first.fit is None and first.impact is not None
    assert "still to come" in first.impact.cor_kinetic.contact.reason
    last, whole = fitted(first), analyse(recording)
    assert last.fit is not None and not fit_pending(last)
    assert repr(last.impact) == repr(whole.impact)
    assert last.flags == whole.flags
    assert repr(last.fit.parameters) == repr(whole.fit.parameters)


def test_where_no_fit_is_wanted_none_is_awaited(recording):
    shot = read(recording, AnalysisSettings(fit=False))
    assert not fit_pending(shot) and fitted(shot).flags == shot.flags


def test_readings_are_told_while_the_fit_is_under_way(recording, analyst, told):
    go_on = threading.Event()

    def slow(shot, progress, cancelled):
        assert go_on.wait(LONGEST_S)
        return fit_here(shot, progress, cancelled)

    begun, ended = analyst(slow)
    assert begun.submit(7, recording)
    while not told:
        assert not ended.wait(0.01)
    assert [(key, problem) for key, _, problem in told] == [(7, None)] and fit_pending(told[0][1])
    assert begun.doing is not None  # the analysis goes on
    go_on.set()
    assert ended.wait(LONGEST_S)
    assert told[1][0] == 7 and told[1][1].fit.converged


@pytest.mark.parametrize(
    ("what", "why"),
    [(AnalysisError("no room to turn"), "no room to turn"), (Cancelled(), "stopped"), (ValueError("odd"), "odd")],
)
def test_a_fit_that_does_not_come_leaves_the_readings_and_says_why(recording, analyst, told, what, why):
    def broken(shot, progress, cancelled):
        raise what

    begun, ended = analyst(broken)
    begun.submit(1, recording)
    assert ended.wait(LONGEST_S)
    shot = told[-1][1]
    assert shot.impact.velocity_in_m_per_s == told[0][1].impact.velocity_in_m_per_s
    assert "fit_failed" in shot.flags and not fit_pending(shot)
    assert why in shot.fit_problem and told[-1][2] is None
    assert shot.fit_stopped is isinstance(what, Cancelled)


def test_a_close_stops_the_analysis_under_way_and_begins_no_other_though_the_queue_is_full():
    told, begun, at_first = [], threading.Event(), []

    def endless(recording, progress, cancelled):
        at_first.append(analyst.doing)
        progress("reading", 0.25)
        begun.set()
        while not cancelled():
            assert not never.wait(0.005)
        raise Cancelled

    never = threading.Event()
    analyst = AnalysisThread(ShotAnalysis(endless, queue_length=2), lambda *all_of_it: told.append(all_of_it))
    assert all(analyst.submit(key, None) for key in (1, 2)) and not analyst.submit(3, None)
    analyst.start()
    assert begun.wait(LONGEST_S) and (analyst.doing, analyst.steps) == (("reading", 0.25), 1)
    while not analyst.submit(4, None):  # the first was taken from the queue
        assert not never.wait(0.001)
    assert analyst.close(LONGEST_S)
    assert told == [(1, None, "the analysis was stopped")] and analyst.doing is None
    assert at_first == [("analysing", 0.0)]


def test_a_cancelling_stops_one_analysis_and_the_next_is_done():
    told, begun, ended = [], threading.Event(), threading.Event()

    def once(recording, progress, cancelled):
        begun.set()
        while recording == "slow" and not cancelled():
            assert not ended.wait(0.005)
        if cancelled():
            raise Cancelled
        raise AnalysisError("no\nbeat")

    def done(*all_of_it):
        told.append(all_of_it)
        if len(told) == 3:
            ended.set()

    analyst = AnalysisThread(ShotAnalysis(once), done)
    analyst.cancel()  # nothing is under way: nothing is stopped
    for key, recording in enumerate(("quick", "slow", "quick")):
        analyst.submit(key, recording)
    analyst.start()
    while not told or analyst.doing is None:
        assert not ended.wait(0.001)
    analyst.cancel()
    assert ended.wait(LONGEST_S) and analyst.close(LONGEST_S)
    assert told == [(0, None, "no beat"), (1, None, "the analysis was stopped"), (2, None, "no beat")]
