"""The worker pool of a dask scheduler: workers are checked before use, and shots of lost workers are repeated."""

import contextlib
import gc
import ipaddress
import logging
import time
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from analysis.shot import version_and_digest
from app.command_line.campaign.task import NotReached, Outcome, ShotTask, analyse_one, why_unusable
from app.command_line.campaign.worker_pool import LOOK_S, WorkersLost
from instrument.background import Task, WorkerThread
from instrument.files import error_words

_UNSAFE = (
    "a network scheduler without TLS accepts code from anyone who can reach it: use tls://HOST:PORT "
    "(docs/installing.md) or --insecure"
)
_NO_ADDRESS = "is not a scheduler address: use tcp://HOST:PORT or tls://HOST:PORT"
_NO_CERTIFICATE = "TLS needs a certificate of your own in dask's configuration (docs/installing.md)"
SCHEDULER_ANSWERS_S = 10.0
SCHEDULER_HANGS_S = 60.0  # longest wait for an answer during a campaign, when the machine may be busy
WORKERS_COME_S = 5.0  # longest wait for a usable worker when a campaign begins
WORKERS_RETURN_S = 15.0  # the same during a campaign; a nanny needs some seconds to restart a worker
SILENT_S = 60.0  # silence after which a worker is lost; workers report twice per second; dask itself waits 5 min
CHECK_S = 60.0  # longest wait for the check of a worker
_WATCH_S = 1.0
_RELEASED_S = 5.0  # longest wait until the thread of a client that could not connect no longer holds it
_MAX_FOLDERS = 200  # most folders checked by each worker; others, if missing, are reported with each shot


class Cluster:
    """Workers of a scheduler that have this program, can read the shots' folders and can write to the export folder.

    ``tell`` is called with a line for each worker that is left out.
    """

    def __init__(
        self, address: str, todo: Sequence[ShotTask], tell: Callable[[str], object], *, insecure: bool = False
    ) -> None:
        if not insecure and not is_secure(address):
            raise WorkersLost(0, _UNSAFE, address)
        self._address, self._client, self._tell = address, _client(address), tell
        folders = sorted({str(Path(task.path).parent) for task in todo})[:_MAX_FOLDERS]
        csv = next((task.motion_csv for task in todo if task.motion_csv), None)
        self._check_of_folders = (version_and_digest(), folders, None if csv is None else str(Path(csv).parent))
        # a hanging scheduler must not block the campaign
        self._watcher = WorkerThread[Task]("scheduler", lambda task: None)
        self._watcher.start()
        self._watching: Task | None = None
        self._watched_at = 0.0
        self._threads: dict[str, int] = {}  # worker -> number of threads, without silent workers
        self._reports: dict[str, tuple[float, float]] = {}  # worker -> (time stamp of last report, time of its arrival)
        self._silent: set[str] = set()
        self._checking: dict[str, tuple[Any, float]] = {}
        self._unfit: dict[str, str] = {}
        self._fit: set[str] = set()
        self._running: dict[Any, tuple[ShotTask, frozenset[str]]] = {}
        self._waiting: deque[ShotTask] = deque()
        self._began = self._without_since = time.monotonic()

    @property
    def width(self) -> int:
        """Get the total number of threads of the usable workers."""
        return sum(self._threads[worker] for worker in self._fit)

    def give(self, task: ShotTask) -> None:
        self._waiting.append(task)

    def take(self) -> list[tuple[ShotTask, Outcome]]:
        """Return finished tasks, or wait briefly if there are none.  Raises WorkersLost."""
        self._watch()
        if self._client.status != "running":
            raise self._lost("the scheduler is gone")
        while self._fit and self._waiting:
            task, workers = self._waiting.popleft(), frozenset(self._fit)
            future = self._submit(analyse_one, task, workers=sorted(workers), pure=False)
            self._running[future] = task, workers
        ready = [future for future in self._running if future.done()]
        if not ready:
            time.sleep(LOOK_S)
        return [taken for future in ready if (taken := self._taken(future)) is not None]

    def close(self) -> None:
        """Disconnect from the scheduler; the next call analyses the unfinished shots."""
        self._watcher.close(0.0)
        with contextlib.suppress(Exception):  # a lost connection times out and is already reported
            self._client.close(timeout=2.0)

    def _submit(self, work: Callable[..., object], *arguments: object, **how: object) -> Any:
        try:
            return self._client.submit(work, *arguments, **how)
        except Exception:  # the client refuses work once its connection is lost
            if self._client.status == "running":
                raise
            raise self._lost("the scheduler is gone") from None

    def _taken(self, future: Any) -> tuple[ShotTask, Outcome] | None:
        task, _ = self._running.pop(future)
        try:
            return task, future.result(timeout=SCHEDULER_HANGS_S)
        except Exception as error:  # three dead workers, a lost connection, no memory for the result
            if self._client.status != "running":
                raise self._lost("the scheduler is gone") from None
            return task, NotReached(f"lost by its worker ({error_words(error)})")

    def _lost(self, cause: str) -> WorkersLost:
        return WorkersLost(0, f"{cause}; finished shots are saved; repeat the command to continue", self._address)

    def _watch(self) -> None:
        """Update the list of workers, at most once per second.  Raises WorkersLost if none is usable."""
        now = time.monotonic()
        if self._watching is None and now - self._watched_at >= _WATCH_S:
            self._watching, self._watched_at = self._watcher.add(Task("workers", self._asked_scheduler)), now
        if self._watching is not None:
            if self._watching.done.is_set():
                self._update(self._watching, now)
                self._watching = None
            elif now - self._watched_at > SCHEDULER_HANGS_S:
                raise self._lost("the scheduler no longer answers")
        self._take_checks(now)
        if self._fit:
            self._without_since = now
        elif not self._checking:
            self._none_usable(now)

    def _asked_scheduler(self, _: object, __: object) -> tuple[dict[str, Any], dict[str, Sequence[str]]]:
        """Ask the scheduler for the state of each worker and the keys of its tasks; waits for the answer."""
        known = self._client.sync(self._client.scheduler.identity)["workers"]
        return known, self._client.processing()

    def _update(self, watching: Task, now: float) -> None:
        try:
            known, keys = watching.wait()
        except OSError:  # connection closed; dask's own message would name sockets and coroutines
            raise self._lost("the scheduler is gone") from None
        except Exception as error:
            raise self._lost(f"the scheduler is gone ({error_words(error)})") from None
        self._listen_for_silence({worker: about["last_seen"] for worker, about in known.items()}, now)
        self._threads = {worker: about["nthreads"] for worker, about in known.items() if worker not in self._silent}
        there = set(self._threads)
        self._fit &= there
        stuck = {key for worker in self._silent for key in keys.get(worker, ())}
        for future, (task, workers) in list(self._running.items()):
            if (not workers & there or future.key in stuck) and not future.done():  # no worker can finish it
                del self._running[future]
                with contextlib.suppress(Exception):  # fails if the connection is lost
                    future.cancel()
                self._waiting.appendleft(task)
        self._checking = {worker: check for worker, check in self._checking.items() if worker in there}
        for worker in there - self._fit - set(self._checking) - set(self._unfit):
            question = self._submit(why_unusable, *self._check_of_folders, workers=[worker], pure=False, priority=10)
            self._checking[worker] = question, time.monotonic()

    def _listen_for_silence(self, last_s: dict[str, float], now: float) -> None:
        """Leave out workers that no longer report: stopped, swapped out, or disconnected."""
        self._reports = {
            worker: before if (before := self._reports.get(worker)) is not None and before[0] == last else (last, now)
            for worker, last in last_s.items()
        }
        silent = {worker for worker, (_, since) in self._reports.items() if now - since > SILENT_S}
        for worker in sorted(silent - self._silent):
            cause = f"has not reported for {SILENT_S:g} s; its shots go to others"
            self._tell(f"worker {worker} is left out: it {cause}")
        self._silent = silent

    def _take_checks(self, now: float) -> None:
        """Collect the results of the workers' checks, and leave out workers that failed."""
        for worker, (answer, checked_since) in list(self._checking.items()):
            if not answer.done() and now - checked_since < CHECK_S:
                continue
            del self._checking[worker]
            try:
                cause = answer.result(timeout=SCHEDULER_HANGS_S) if answer.done() else "does not answer"
            except Exception as error:
                cause = f"cannot run levimass ({error_words(error)})"
            if cause is None:
                self._fit.add(worker)
            else:
                self._unfit[worker] = cause
                self._tell(f"worker {worker} is left out: it {cause}")

    def _none_usable(self, now: float) -> None:
        at_first = self._without_since == self._began
        if now - self._without_since < (WORKERS_COME_S if at_first else WORKERS_RETURN_S):
            return
        if self._unfit:
            raise self._lost("none of its workers can do this work")
        start = f"start some on each machine: dask worker {self._address} --nworkers auto --nthreads 1"
        raise self._lost(f"it has no worker; {start}")


def _client(address: str) -> Any:
    """Return a client of the scheduler.  Raises WorkersLost, or OSError if dask.distributed is missing."""
    try:
        from distributed import Client
    except ImportError:
        raise OSError(0, "needs dask.distributed: pip install 'levimass[cluster]'", "--scheduler") from None
    _silence_libraries()
    client = Client.__new__(Client)  # so that one that does not connect can be watched until it is deleted
    try:
        Client.__init__(client, address, timeout=SCHEDULER_ANSWERS_S, set_as_default=False)
        return client
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        why = _why_not_connected(error)
    incomplete, until_s = weakref.ref(client), time.monotonic() + _RELEASED_S
    del client
    gc.collect()  # deletes the incomplete client, which would block on a lock for ever once another client starts
    while incomplete() is not None and time.monotonic() < until_s:  # its thread still holds it after telling why
        time.sleep(0.01)
        gc.collect()
    raise WorkersLost(0, why, address)


def _silence_libraries() -> None:
    """Keep dask's log off standard error; this program reports the relevant problems in one line each.

    Each logger is set separately, because dask's configuration gives some loggers their own level.
    """
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


def is_secure(address: str) -> bool:
    """Return whether a scheduler's address is on this machine, or protected by TLS."""
    scheme, there, rest = address.partition("://")
    if not there:
        scheme, rest = "tcp", address
    if scheme.lower() in ("tls", "wss", "inproc"):
        return True
    if "@" in rest:  # dask takes the whole text, with "@", for the host name
        return False
    try:
        host = urlsplit(f"//{rest}").hostname or ""
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a host name
        return False


def _why_not_connected(error: Exception) -> str:
    if "ssl_context" in str(error):
        return _NO_CERTIFICATE
    if isinstance(error, ValueError):
        return _NO_ADDRESS
    return getattr(error, "strerror", None) or error_words(error)
