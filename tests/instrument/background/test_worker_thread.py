"""A worker thread: order, progress, cancellation, errors, and its end."""

import threading
import weakref

import pytest

from analysis.shot.shot import Cancelled
from instrument.background import worker_thread
from instrument.background.worker_thread import Task, WorkerThread, beside

LONGEST_S = 20.0


@pytest.fixture
def thread():
    made = WorkerThread("test")
    yield made
    assert made.close(LONGEST_S) and not made.alive


class Held:
    """Work that runs until it may go on, or until it is cancelled."""

    def __init__(self):
        self.begun, self.may_end = threading.Event(), threading.Event()

    def __call__(self, report, cancelled):
        report("half", 0.5)
        self.begun.set()
        while not self.may_end.wait(0.002):
            if cancelled():
                raise Cancelled
        return "held"


def test_tasks_queued_before_the_start_run_in_order_in_one_thread_that_keeps_no_program_running(thread):
    seen = []
    tasks = [thread.add(Task(str(n), lambda _, __, n=n: seen.append((n, threading.current_thread())))) for n in (1, 2)]
    assert thread.tasks == tasks and thread.queued == 2 and not thread.alive
    thread.start()
    for task in tasks:
        task.wait()
    assert [n for n, _ in seen] == [1, 2] and len({own for _, own in seen}) == 1
    assert seen[0][1].name == "levimass test" and seen[0][1].daemon and thread.alive


def test_what_is_done_and_what_waits_is_seen_meanwhile(thread):
    held = Held()
    first, second = thread.add(Task("first", held)), thread.add(Task("second", lambda _, __: 2))
    thread.start()
    assert held.begun.wait(LONGEST_S)
    assert (thread.current, thread.queued, thread.tasks) == (first, 1, [second, first])
    assert (first.what, first.fraction, first.done.is_set()) == ("half", 0.5, False) and first.started_s is not None
    held.may_end.set()
    assert (first.wait(), second.wait(), thread.current, thread.tasks) == ("held", 2, None, [])


def test_a_cancelled_task_stops_at_its_next_check_or_does_not_begin_and_the_next_is_done(thread):
    held, seen = Held(), []
    running, queued = thread.add(Task("running", held)), thread.add(Task("queued", lambda _, __: seen.append(1)))
    after = thread.add(Task("after", lambda _, __: "done"))
    thread.start()
    assert held.begun.wait(LONGEST_S)
    running.cancel()
    queued.cancel()
    assert after.wait() == "done" and seen == [] and queued.started_s is None
    for task in (running, queued):
        with pytest.raises(Cancelled):
            task.wait()


def test_an_error_goes_to_who_waits_for_it_or_is_told_as_uncaught(monkeypatch):
    told = []
    monkeypatch.setattr(threading, "excepthook", lambda what: told.append((what.exc_value, what.thread.name)))
    thread = WorkerThread("test")
    thread.start()
    broken = thread.add(Task("broken", lambda _, __: {}["lost"]))
    with pytest.raises(KeyError, match="lost") as raised:
        broken.wait()
    assert broken.problem == "'lost'" and thread.add(Task("next", lambda _, __: 1)).wait() == 1
    assert told == [(raised.value, "levimass test")] and thread.close(LONGEST_S)


@pytest.mark.parametrize("finish", [False, True])
def test_a_close_cancels_or_finishes_what_waits_and_begins_nothing_that_comes_later(finish):
    ended, held = [], Held()
    thread = WorkerThread("test", ended.append)
    tasks = [thread.add(Task("first", held)), thread.add(Task("second", lambda _, __: None))]
    thread.start()
    assert held.begun.wait(LONGEST_S)
    assert not thread.close(0.01, finish=finish) or not finish
    late = thread.add(Task("late", lambda _, __: None))
    held.may_end.set()
    assert thread.close(LONGEST_S, finish=finish) and not thread.alive
    assert [task for task in ended if task is not late] == tasks and late.cancelled and late.started_s is None
    assert [task.cancelled for task in tasks] == [not finish] * 2


def test_a_thread_that_hangs_is_left_behind_in_time():
    held, thread = threading.Event(), WorkerThread("test")
    thread.add(Task("deaf", lambda _, __: held.wait(LONGEST_S)))
    thread.start()
    assert not thread.close(0.01) and thread.alive
    held.set()
    assert thread.close(LONGEST_S)


def test_a_waiting_thread_keeps_nothing_of_its_last_task_in_memory(thread):
    class Data:
        pass

    data = Data()
    gone = weakref.ref(data)
    thread.start()
    thread.add(Task("large", lambda _, __, data=data: None)).wait()
    thread.add(Task("small", lambda _, __: None)).wait()
    del data
    assert gone() is None


def test_work_beside_a_block_gives_its_result_and_ends_with_the_block():
    with beside("test", lambda report, cancelled: 7) as task:
        assert task.wait() == 7
    held = Held()
    with pytest.raises(ValueError, match="block"), beside("test", held) as task:
        assert held.begun.wait(LONGEST_S)
        raise ValueError("the block failed")
    assert task.cancelled and task.done.is_set()
    with pytest.raises(ZeroDivisionError), beside("test", lambda report, cancelled: 1 / 0) as task:
        task.wait()


def test_a_started_thread_keeps_no_program_running():
    seen = []
    thread = worker_thread.start_thread("name", seen.append, 3)
    thread.join(LONGEST_S)
    assert (thread.name, thread.daemon, seen) == ("name", True, [3])
