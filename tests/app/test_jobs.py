"""Work beside the screen: results, failures, cancel, and a thread that ends."""

import threading

from analysis.shot.shot import Cancelled
from app.session.jobs import Jobs


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
