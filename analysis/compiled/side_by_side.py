"""Independent work on two cores: the kernels let go of the interpreter."""

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
_POOL = ThreadPoolExecutor(16)  # threads: more than work, as some wait for the work within their work


class _Idle:
    """How many cores nothing works on, so far as is known here: below zero where several callers came at once."""

    def __init__(self, count: int) -> None:
        self._count, self._lock = count, threading.Lock()

    def taken(self) -> bool:
        """Take a core if one is idle, and return whether one was."""
        with self._lock:
            if self._count <= 0:
                return False
            self._count -= 1
            return True

    def change(self, by: int) -> None:
        """Say that a core works no longer (+1), or works again (-1), idle or not: nobody waits for one."""
        with self._lock:
            self._count += by


_idle = _Idle(1)  # besides the caller's own


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return ``function`` of every item, in their order; two at a time, and within such work too where a core idles.

    Who asks works as well; a core that is idle, or becomes so, takes what is not begun.  After an error nothing more
    is begun; of several that of the first item is raised.
    """
    shared = _Shared(function, list(items))
    helper: Future[None] | None = None
    while (place := shared.next_place()) is not None:
        if helper is None and shared.waiting and _idle.taken():
            helper = _POOL.submit(shared.help_out)
        shared.do(place)
    if helper is not None:
        _idle.change(+1)  # this core, for what is shared out within the work that is waited for; or the helper's
        if not helper.cancel():  # begun, as it nearly always is
            helper.result()
            _idle.change(-1)
    return shared.results()


class _Shared(Generic[Item, Result]):
    """Items of which whoever is free takes the next."""

    def __init__(self, function: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._function, self._items = function, items
        self._done: dict[int, Result] = {}
        self._errors: dict[int, BaseException] = {}
        self._next, self._lock = 0, threading.Lock()

    @property
    def waiting(self) -> bool:
        """Get whether an item is not begun."""
        return self._next < len(self._items) and not self._errors

    def next_place(self) -> int | None:
        """Return the place of an item that is the caller's to do, or None where none is left."""
        with self._lock:
            if not self.waiting:
                return None
            self._next += 1
            return self._next - 1

    def do(self, place: int) -> None:
        """Do one item, and keep what comes of it."""
        try:
            self._done[place] = self._function(self._items[place])
        except BaseException as error:  # raised where the work was asked for
            self._errors[place] = error

    def help_out(self) -> None:
        """Do what is left, on a core that was idle."""
        try:
            while (place := self.next_place()) is not None:
                self.do(place)
        finally:
            _idle.change(+1)

    def results(self) -> list[Result]:
        """Return what came of every item, or raise the first error."""
        if self._errors:
            raise self._errors[min(self._errors)]
        return [self._done[place] for place in range(len(self._items))]
