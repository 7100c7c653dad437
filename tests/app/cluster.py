"""A real dask scheduler and its workers, each a process of its own on the loopback address."""

import contextlib
import json
import os
import subprocess
import sys
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
            process.kill()
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
