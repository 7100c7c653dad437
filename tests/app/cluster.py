"""A real dask scheduler and its workers, each a process of its own on the loopback address."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

HOUSE = Path(__file__).resolve().parents[2]


class LoopbackCluster:
    """Starts scheduler and workers, and ends what it started."""

    def __init__(self, folder: Path, installed: Path = HOUSE) -> None:
        """Begin in ``folder``; the program is what lies in ``installed``."""
        self._folder, self._installed = folder, installed
        self._scheduler_file = folder / "scheduler.json"
        self._processes: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("scheduler", folder, "--port", "0", "--no-dashboard", "--no-show")
        end = time.monotonic() + 60
        self.address = ""
        while not self.address:
            assert time.monotonic() < end and self.scheduler.poll() is None, "the scheduler does not start"
            time.sleep(0.05)
            with contextlib.suppress(OSError, ValueError):
                self.address = json.loads(self._scheduler_file.read_text())["address"]

    def worker(self, folder: Path) -> subprocess.Popen[bytes]:
        """Start a worker that stands in ``folder``."""
        return self._start("worker", folder, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def close(self) -> None:
        """End every process."""
        for process in self._processes:
            process.kill()  # a stopped one, too
            process.wait()

    def _start(self, what: str, folder: Path, *more: str) -> subprocess.Popen[bytes]:
        paths = os.pathsep.join(filter(None, (str(self._installed), os.environ.get("PYTHONPATH"))))
        with open(self._folder / f"{what}-{len(self._processes)}.log", "wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(self._scheduler_file),
                 "--host", "127.0.0.1", *more],
                cwd=folder, env=os.environ | {"PYTHONPATH": paths}, stdout=log, stderr=log,
            )  # fmt: skip
        self._processes.append(process)
        return process


def kill(process: "subprocess.Popen[bytes]") -> None:
    """End a process as a power cut does."""
    with contextlib.suppress(ProcessLookupError):
        process.kill()
    process.wait()


class Line:
    """A line of the network between a client and the scheduler, that can be cut; ``address`` is its near end."""

    def __init__(self, scheduler: str) -> None:
        host, _, port = scheduler.removeprefix("tcp://").rpartition(":")
        self._far = host, int(port)
        self._near = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self.address = f"tcp://127.0.0.1:{self._near.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def cut(self) -> None:
        """End every connection, and take no other."""
        for end in (self._near, *self._ends):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._near.accept()
                far = socket.create_connection(self._far)
                self._ends += (near, far)
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=_carry, args=(one, other), daemon=True).start()


def _carry(one: socket.socket, other: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while piece := one.recv(65536):
            other.sendall(piece)
    for end in (one, other):
        with contextlib.suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
