"""Cases run side by side in processes, each outcome kept at once: a run that was cut off goes on where it stopped."""

import json
import multiprocessing
import os
import random
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any


def kept_runs(
    todo: Sequence[Any],
    run: Callable[[Any], Any],
    processes: int,
    keep: Path | None,
    from_json: Callable[[dict[str, Any]], Any],
) -> Iterator[Any]:
    """Yield the outcome of every case, those kept in ``keep`` first; ``from_json`` makes one of what its line holds.

    An outcome has its ``case`` and ``as_json``; ``run`` is called in a process of its own.
    """
    kept = {outcome.case: outcome for outcome in map(from_json, _lines(keep))}
    yield from (kept[case] for case in todo if case in kept)
    left = [case for case in todo if case not in kept]
    random.Random(0).shuffle(left)  # a run that is cut off is then a fair sample of all
    yield from pooled(left, run, processes, keep, lambda outcome: outcome.as_json())


def pooled(
    left: Sequence[Any],
    run: Callable[[Any], Any],
    processes: int,
    keep: Path | None,
    as_json: Callable[[Any], dict[str, Any]],
) -> Iterator[Any]:
    """Yield what ``run`` makes of each of ``left``, as it comes, and write it to ``keep``, a JSON object a line."""
    # spawned, and one thread each: a kernel's own threads would fight over the cores
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for outcome in pool.imap_unordered(run, left, chunksize=1):
            if keep:
                keep.parent.mkdir(parents=True, exist_ok=True)
                with keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(as_json(outcome)) + "\n")
            yield outcome


def _lines(keep: Path | None) -> Iterator[dict[str, Any]]:
    if keep is not None and keep.exists():
        yield from map(json.loads, keep.read_text(encoding="utf-8").splitlines())
