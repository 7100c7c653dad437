"""Independent work on two cores: the kernels let go of the interpreter."""

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
_POOL = ThreadPoolExecutor(2)
_here = threading.local()


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return ``function`` of every item, in their order; two at a time, unless this is itself done beside something.

    Work within such work waits for no thread, so that two of the same pool never wait for each other.
    """
    each = list(items)
    if len(each) < 2 or getattr(_here, "beside", False):
        return [function(item) for item in each]

    def beside(item: Item) -> Result:
        _here.beside = True
        return function(item)

    return list(_POOL.map(beside, each))
