"""A worker process: messages both ways, its death, and its end by force."""

import os
import signal
import sys
import threading
import time
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from instrument.background.worker_process import ProcessEnded, WorkerProcess

LONGEST_S = 60.0


def echo(greeting: str, orders: Any, messages: Any) -> None:
    """Send the greeting, then whatever comes, until the orders end."""
    messages.send(greeting)
    try:
        while True:
            messages.send(orders.recv())
    except EOFError:
        sys.exit(7)


def deaf(orders: Any, messages: Any) -> None:
    """Do not heed the end of the orders."""
    messages.send("started")
    time.sleep(LONGEST_S)


def quits(orders: Any, messages: Any) -> None:
    """End by itself."""
    messages.send("last words")
    sys.exit(2)


def test_messages_go_both_ways_until_the_process_is_told_to_end() -> None:
    process = WorkerProcess("echo", echo, "here")
    assert process.receive(LONGEST_S) == "here" and process.exit_code is None and not process.over
    view = MappingProxyType({"a": 1, "b": MappingProxyType({})})
    process.send(view)
    again = process.receive(LONGEST_S)
    assert type(again) is MappingProxyType and again == view and type(again["b"]) is MappingProxyType
    assert process.receive(0.01) is None
    process.end(LONGEST_S)
    process.end(LONGEST_S)
    assert process.over and process.exit_code == 7
    with pytest.raises(ProcessEnded):
        process.send("late")
    with pytest.raises(ProcessEnded):
        process.receive(0.0)


def test_a_process_that_ends_by_itself_is_told_with_its_status_after_its_last_message() -> None:
    process = WorkerProcess("quits", quits)
    assert process.receive(LONGEST_S) == "last words"
    with pytest.raises(ProcessEnded, match="status 2"):
        process.receive(LONGEST_S)
    assert process.over and process.exit_code == 2


def test_a_process_that_is_killed_is_told_with_its_signal() -> None:
    process = WorkerProcess("echo", echo, "here")
    assert process.receive(LONGEST_S) == "here"
    pid = process._process.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(ProcessEnded, match="killed by signal 9"):
        process.receive(LONGEST_S)


def test_a_process_that_does_not_end_is_killed_after_its_patience() -> None:
    process = WorkerProcess("deaf", deaf)
    assert process.receive(LONGEST_S) == "started"
    began = time.monotonic()
    process.end(0.2)
    assert process.exit_code == -signal.SIGKILL and 0.2 <= time.monotonic() - began < 5.0


def test_a_message_that_is_stuck_does_not_keep_a_process_from_being_ended() -> None:
    process, told = WorkerProcess("deaf", deaf), []
    assert process.receive(LONGEST_S) == "started"

    def send() -> None:
        try:
            process.send(bytes(10_000_000))  # more than a pipe holds, and nobody reads it
        except ProcessEnded as error:
            told.append(error)

    sending = threading.Thread(target=send, daemon=True)
    sending.start()
    while not process._sending.locked():
        time.sleep(0.001)
    process.end(0.1)
    sending.join(LONGEST_S)
    assert process.exit_code == -signal.SIGKILL and len(told) == 1


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="read from Linux's list of processes")
def test_ctrl_c_is_left_to_the_parent_from_the_start_on() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    process = WorkerProcess("echo", echo, "here")
    pid = process._process.pid

    def bits(which: str) -> int:
        status = dict(line.split(":\t") for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        return int(status[which], 16) & 1 << (signal.SIGINT - 1)

    assert bits("SigBlk") and signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
    assert process.receive(LONGEST_S) == "here" and bits("SigIgn")
    process.end(LONGEST_S)
