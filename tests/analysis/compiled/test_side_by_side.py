"""Parallel work: two items at a time, nested too, and every core is released."""

import os
import subprocess
import sys
import threading
import time

import pytest

from analysis.compiled.two_threads import side_by_side

TOGETHER_S = 20.0  # long enough for a busy machine to bring two threads to the same place


def _meet(within_s: float = TOGETHER_S) -> None:
    """Do two items that can only be done at once; BrokenBarrierError where one waits for the other in vain."""
    both = threading.Barrier(2, timeout=within_s)
    side_by_side(lambda _: both.wait(), range(2))


def test_results_stand_in_the_order_of_the_items() -> None:
    def slow_at_first(item: int) -> int:
        time.sleep(0.02 if item == 0 else 0.0)
        return item * item

    assert side_by_side(slow_at_first, range(9)) == [n * n for n in range(9)]
    assert side_by_side(slow_at_first, []) == []


def test_two_items_are_done_at_once() -> None:
    _meet()


def test_a_core_that_became_idle_takes_work_within_the_work_that_is_left() -> None:
    short_done = threading.Event()

    def one(item: str) -> None:
        if item == "short":
            short_done.set()
            return
        assert short_done.wait(TOGETHER_S)
        deadline = time.monotonic() + TOGETHER_S
        while True:  # the core is given back a moment after the short item's end
            try:
                _meet(0.5)
                break
            except threading.BrokenBarrierError:
                assert time.monotonic() < deadline, "no core took what was shared out"

    side_by_side(one, ["long", "short"])
    short_done.clear()
    side_by_side(one, ["short", "long"])


def test_no_more_than_two_work_at_once_at_whatever_depth() -> None:
    lock, now, most = threading.Lock(), 0, 0

    def leaf(_: int) -> None:
        nonlocal now, most
        with lock:
            now += 1
            most = max(most, now)
        time.sleep(0.001)
        with lock:
            now -= 1

    def deep(depth: int) -> None:
        side_by_side(lambda n: leaf(n) if depth == 0 else deep(depth - 1), range(3))

    deep(3)
    assert most == 2


def test_the_first_items_error_is_raised_and_nothing_more_is_begun() -> None:
    begun = []

    def fails(item: int) -> None:
        begun.append(item)
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 0"):
        side_by_side(fails, range(50))
    assert len(begun) <= 2
    _meet()  # the core that failed was given back


def test_callers_of_their_own_do_not_wait_for_each_other_for_ever() -> None:
    def ask() -> None:
        for _ in range(20):
            side_by_side(lambda n: sum(side_by_side(lambda k: k * n, range(4))), range(4))

    callers = [threading.Thread(target=ask, daemon=True) for _ in range(6)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(TOGETHER_S)
    assert not any(caller.is_alive() for caller in callers)
    _meet()


def test_the_algebra_takes_one_thread_even_where_numpy_was_imported_first() -> None:
    """With more of them the fits of a script took seven times as long, and those in a building ran out of time."""
    imports = "import numpy, analysis, scipy.linalg, threadpoolctl"
    script = f"{imports}\nprint({{pool['num_threads'] for pool in threadpoolctl.threadpool_info()}})"
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    told = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "{1}"
