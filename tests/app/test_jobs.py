"""Work beside the screen: results, failures, cancel, and a thread that ends."""

import threading
from pathlib import Path

import pytest

from analysis.shot.shot import Cancelled
from app.session import jobs as module
from app.session.entry import Entry
from app.session.jobs import Job, JobQueues, Jobs, Saver, ShotJob


def _wait(job, jobs):
    assert job.done.wait(10)
    return jobs.finished()


def test_results_and_failures_come_back_and_the_thread_lives_on():
    jobs = Jobs()
    try:
        good = jobs.submit("good", lambda report, cancelled: 7)
        bad = jobs.submit("bad", lambda report, cancelled: 1 / 0)
        after = jobs.submit("after", lambda report, cancelled: 8)
        _wait(after, jobs)
        assert (good.result, after.result) == (7, 8)
        assert "division" in bad.problem
    finally:
        assert jobs.close()


def _endless():
    """Return a flag and a job that raises it, then runs until it is told to stop."""
    started = threading.Event()

    def endless(report, cancelled):
        started.set()
        while not cancelled():
            threading.Event().wait(0.002)
        raise Cancelled

    return started, endless


def test_cancel_reaches_the_job_under_way_and_those_that_wait():
    jobs = Jobs()
    started, endless = _endless()
    try:
        first, second = jobs.submit("first", endless, "diagnosis"), jobs.submit("second", endless, "diagnosis")
        other = jobs.submit("other", lambda report, cancelled: "kept", "export")
        assert started.wait(10)
        jobs.cancel("diagnosis")
        ended = _wait(other, jobs)
        assert first.cancelled and second.cancelled
        assert other.result == "kept"
        assert len(ended) == 3
    finally:
        assert jobs.close()


def test_close_ends_a_job_that_listens():
    jobs = Jobs()
    started, endless = _endless()
    jobs.submit("endless", endless)
    assert started.wait(10)
    assert jobs.close(5)


@pytest.mark.parametrize(
    ("gone_s", "fraction", "left_s"),
    [
        (10.0, 0.25, 30.0),
        (10.0, 0.05, 190.0),
        (10.0, 0.049, None),
        (10.0, 1.0, None),
        (2.0, 0.5, None),
        (2.1, 0.5, 2.1),
    ],
)
def test_the_time_left_is_told_once_it_can_be_estimated(monkeypatch, gone_s, fraction, left_s):
    monkeypatch.setattr(module.time, "monotonic", lambda: 100.0 + gone_s)
    job = Job("x", lambda report, cancelled: None, fraction=fraction, started_s=100.0)
    assert job.remaining_s() == (left_s if left_s is None else pytest.approx(left_s))
    job.started_s = None
    assert job.remaining_s() is None


@pytest.fixture
def held():
    """Return jobs whose thread is held by one called "first" until the event is set."""
    jobs, go_on, begun = Jobs(), threading.Event(), threading.Event()

    def first(report, cancelled):
        report("half", 0.5)
        begun.set()
        go_on.wait(10)

    job = jobs.submit("first", first, "open")
    assert begun.wait(10)
    yield jobs, go_on, job
    go_on.set()
    assert jobs.close()


def test_work_that_yields_is_cancelled_by_any_other_and_by_none_of_its_kind(held):
    jobs, _, _ = held
    why, again = jobs.submit("why", lambda *_: 1, "why"), jobs.submit("again", lambda *_: 2, "why")
    assert not why.cancelled and jobs.waiting("why") == 2 and jobs.open_jobs == 3
    other = jobs.submit("other", lambda *_: 3, "refit")
    assert why.cancelled and again.cancelled and not other.cancelled
    assert (jobs.waiting("why"), jobs.waiting("open", "refit"), jobs.open_jobs) == (0, 2, 4)


def test_a_job_says_what_it_does_and_which_comes_before_it(held):
    jobs, go_on, first = held
    second = jobs.submit("second", lambda *_: 2)
    assert jobs.current is first and (first.what, first.fraction) == ("half", 0.5)
    assert jobs.waiting_words(first, "spectra") == "computing spectra …"
    assert jobs.waiting_words(second, "spectra") == "waiting for first to end; then spectra will be computed"
    go_on.set()
    assert second.done.wait(10)
    assert jobs.waiting_words(second, "spectra") == "computing spectra …"
    assert [job.name for job in jobs.finished()] == ["first", "second"] and jobs.finished() == []


def test_after_its_end_nothing_more_is_done_and_what_waits_is_done_only_if_asked():
    for finish in (False, True):
        jobs, done = Jobs(), []
        started, endless = threading.Event(), threading.Event()

        def first(report, cancelled, started=started, endless=endless):
            started.set()
            endless.wait(0.2)

        jobs.submit("first", first)
        assert started.wait(10)
        jobs.submit("second", lambda *_, done=done: done.append(2))
        assert jobs.close(finish=finish) and done == ([2] if finish else [])
        assert jobs.submit("late", lambda *_, done=done: done.append(3)).cancelled


def test_a_saver_does_the_newest_task_it_was_given():
    saver, begun, go_on, done = Saver(), threading.Event(), threading.Event(), []

    def slow():
        begun.set()
        go_on.wait(10)
        done.append("slow")

    saver.submit(slow)
    assert begun.wait(10)
    saver.submit(lambda: done.append("replaced"))
    saver.submit(lambda: done.append("newest"))
    go_on.set()
    assert saver.close() and done == ["slow", "newest"]


def test_results_of_a_session_are_dropped_once_another_is_open_and_failures_are_said():
    work, taken = JobQueues(None), []
    try:
        of_first = work.jobs.submit("one", lambda *_: 1, "open", taken.append)
        assert of_first.done.wait(10)
        work.cancel_session_jobs()
        of_second = work.short_jobs.submit("two", lambda *_: 2, "open", taken.append)
        failed = work.jobs.submit("three", lambda *_: {}["missing"])
        of_none = work.jobs.submit("four", lambda *_: 4, take=taken.append)
        for job in (of_second, failed, of_none):
            assert job.done.wait(10)
        assert list(work.collect_results()) == ["three: 'missing'"]
        assert sorted(taken) == [2, 4] and list(work.collect_results()) == []
        long = work.submit_long("long", lambda progress, cancelled: (progress("half", 0.5), cancelled()), "", print)
        assert long.done.wait(10) and (long.what, long.fraction, long.result) == ("half", 0.5, (None, False))
    finally:
        assert work.close()


@pytest.mark.parametrize("kind", ["open", "refit", "diagnosis", "plan", "kept", "model"])
def test_another_session_cancels_the_work_of_this_one_and_no_other(held, kind):
    jobs, _, _ = held
    work = JobQueues(None)
    work.jobs.close()
    work.jobs = jobs
    mine, export = jobs.submit("x", lambda *_: 1, kind), jobs.submit("y", lambda *_: 1, "export")
    work.cancel_session_jobs()
    assert mine.cancelled and not export.cancelled
    work.short_jobs.close()


def test_work_on_the_shot_in_view_is_done_once_for_each_and_given_out_once():
    queues = JobQueues(None)
    jobs, asked, taken = queues.jobs, [], []

    def work(entry, given):
        def made(report, cancelled):
            asked.append((entry.number, given))
            if given == "fail":
                raise ValueError("no")
            return 10 * entry.number

        return entry, made

    def ended():
        assert of.job.done.wait(10)
        said = list(queues.collect_results())
        assert of.job is None
        return said

    of = ShotJob(jobs, "spectra", lambda *result: taken.append(result))
    one, two = (Entry(n, f"s{n}", Path("x"), None) for n in (1, 2))
    try:
        assert of.job is None
        assert of.start(*work(one, "a")) and not of.start(*work(one, "b"))
        assert of.job is not None and of.job.name == "spectra of s1"
        assert ended() == [] and taken == [(one, 10)] and not of.start(*work(one, "c"))
        of.forget()
        assert of.start(*work(one, "d"))
        first = of.job
        assert of.start(*work(two, "fail")) and first.cancelled
        assert ended() == ["spectra of s2: no"] and taken == [(one, 10)]  # nor is the replaced one taken, if it ended
        assert of.start(*work(two, "e"))  # what failed is tried again
        assert ended() == [] and taken == [(one, 10), (two, 20)]
        assert asked[0] == (1, "a") and asked[-1] == (2, "e")
    finally:
        assert queues.close()


def test_a_job_that_fails_or_is_cancelled_is_told_to_who_asked_for_it_unless_it_was_discarded(held):
    jobs, go_on, _ = held
    queues, ends = JobQueues(None), []
    queues.jobs.close()
    queues.jobs = jobs

    def submit(name, work):
        return jobs.submit(name, work, "", lambda result: ends.append((name, result)), lambda why: ends.append(why))

    submit("good", lambda *_: 1)
    submit("bad", lambda *_: {}["lost"])
    submit("cancelled", lambda *_: 2).cancel()
    submit("discarded", lambda *_: 3).discard()
    last = submit("last", lambda *_: 4)
    go_on.set()
    assert last.done.wait(10)
    assert list(queues.collect_results()) == ["bad: 'lost'"]
    assert ends == [("good", 1), "'lost'", None, ("last", 4)]
    queues.short_jobs.close()
