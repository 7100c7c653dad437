"""A campaign over a running cluster whose parts end one by one: each shot is analysed, or one line says why not."""

import os
import signal
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.command_line.campaign import cluster as parts
from app.command_line.campaign.task import ShotTask
from app.command_line.campaign.worker_pool import WorkersLost
from app.command_line.cli import main
from tests.app.campaign_call import Call, in_journal
from tests.app.cluster import Line, LoopbackCluster, kill

pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
SHOTS = 6


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    assert main(["--simulate", str(folder / "one"), "--shots", "1", "--seed", "4"]) == 0
    assert main(["--replay", str(folder / "one"), "--no-diagnose"]) == 0  # kernels are on disk from here on
    (folder / "shots").mkdir()
    for number in range(SHOTS):
        for file in (folder / "one").iterdir():
            os.link(file, folder / "shots" / f"copy-{number}{file.suffix}")
    return folder / "shots"


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LoopbackCluster]:
    monkeypatch.setattr(parts, "WORKERS_COME_S", 90.0)  # on a machine that does other things beside
    running = LoopbackCluster(tmp_path)
    yield running
    running.close()


def _begun(shots: Path, out: Path, address: str) -> Call:
    """Begin a campaign and return it once its first shot is done."""
    call = Call("--replay", str(shots), "--no-diagnose", "--export", str(out), "--scheduler", address)
    call.has_come_to(out, 1)
    return call


def _assert_gone_on(shots: Path, out: Path, capfd: pytest.CaptureFixture[str], done: int) -> None:
    """Check that the same command on this machine does what is missing, and that alone."""
    assert 1 <= done <= SHOTS
    assert main(["--replay", str(shots), "--no-diagnose", "--export", str(out), "--jobs", "1"]) == 0
    assert f"{SHOTS} shots, {SHOTS} analysed, 0 failed" in capfd.readouterr().out and in_journal(out) == SHOTS


@pytest.mark.slow
def test_a_network_that_breaks_is_said_in_one_line(
    shots: Path, tmp_path: Path, cluster: LoopbackCluster, capfd: pytest.CaptureFixture[str]
) -> None:
    cluster.worker(tmp_path)
    line, out = Line(cluster.address), tmp_path / "out"
    call = _begun(shots, out, line.address)
    line.cut()
    assert call.ended() == 1
    said = capfd.readouterr().err
    assert said.count("\n") == 1 and "the scheduler is gone" in said and "repeat the command to continue" in said, said
    _assert_gone_on(shots, out, capfd, in_journal(out))


@pytest.mark.slow
def test_all_workers_killed_and_one_that_comes_does_the_rest(
    shots: Path, tmp_path: Path, cluster: LoopbackCluster, capfd: pytest.CaptureFixture[str]
) -> None:
    workers, out = [cluster.worker(tmp_path) for _ in range(2)], tmp_path / "out"
    call = _begun(shots, out, cluster.address)
    for worker in workers:
        kill(worker)
    cluster.worker(tmp_path)
    assert call.ended() == 0
    assert f"{SHOTS} shots, {SHOTS} analysed, 0 failed" in capfd.readouterr().out and in_journal(out) == SHOTS


@pytest.mark.slow
@pytest.mark.parametrize("scheduler_too", [False, True])
def test_all_workers_killed_is_said_in_one_line(
    shots: Path, tmp_path: Path, cluster: LoopbackCluster, scheduler_too: bool, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(parts, "WORKERS_RETURN_S", 2.0)
    workers, out = [cluster.worker(tmp_path) for _ in range(2)], tmp_path / "out"
    call = _begun(shots, out, cluster.address)
    for part in (*workers, *([cluster.scheduler] if scheduler_too else [])):
        kill(part)
    assert call.ended() == 1
    said = capfd.readouterr().err
    words = "the scheduler is gone" if scheduler_too else "it has no worker; start some on each machine"
    assert said.count("\n") == 1 and words in said, said
    _assert_gone_on(shots, out, capfd, in_journal(out))


@pytest.mark.slow
def test_the_shots_of_a_worker_that_stops_reporting_go_to_another(
    shots: Path, tmp_path: Path, cluster: LoopbackCluster, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(parts, "SILENT_S", 15.0)
    workers, out = [cluster.worker(tmp_path) for _ in range(2)], tmp_path / "out"
    call = _begun(shots, out, cluster.address)
    workers[0].send_signal(signal.SIGSTOP)
    assert call.ended() == 0
    said = capfd.readouterr()
    assert f"{SHOTS} shots, {SHOTS} analysed, 0 failed" in said.out
    assert said.err == "" or (said.err.count("\n") == 1 and "has not reported for 15 s" in said.err), said.err


@pytest.mark.slow
def test_a_scheduler_that_stops_answering_is_said_in_one_line(
    shots: Path, tmp_path: Path, cluster: LoopbackCluster, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    cluster.worker(tmp_path)
    out = tmp_path / "out"
    call = _begun(shots, out, cluster.address)
    monkeypatch.setattr(parts, "SCHEDULER_HANGS_S", 5.0)
    cluster.scheduler.send_signal(signal.SIGSTOP)
    assert call.ended() == 1
    said = capfd.readouterr().err
    assert said.count("\n") == 1 and "no longer answers" in said, said
    _assert_gone_on(shots, out, capfd, in_journal(out))


class _BrokenClient:
    """A client whose connection breaks between one look at it and the next."""

    status = "running"

    def __init__(self, *_: object, **__: object) -> None:
        self.scheduler = types.SimpleNamespace(identity=None)

    def sync(self, _: object) -> dict[str, Any]:
        return {"workers": {"tcp://127.0.0.1:1": {"last_seen": 1.0, "nthreads": 1}}}

    def processing(self) -> dict[str, Any]:
        return {}

    def nthreads(self) -> dict[str, int]:
        return {"tcp://127.0.0.1:1": 1}

    def submit(self, *_: object, **__: object) -> None:
        self.status = "closed"
        raise RuntimeError("Client is closed. Can't send update-graph message.")

    def close(self, timeout: float) -> None:
        raise TimeoutError


def test_a_client_that_breaks_while_work_is_handed_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", types.SimpleNamespace(Client=_BrokenClient))
    task = ShotTask("/shots/a.sigmf-meta", None, None, None, True, "stamp", ())  # type: ignore[arg-type]
    workers = parts.Cluster("tcp://127.0.0.1:2", [task], print)
    workers.give(task)
    with pytest.raises(WorkersLost, match="the scheduler is gone; finished shots are saved"):
        for _ in range(100):
            workers.take()
    workers.close()
