"""A campaign over a real scheduler and two workers: wrong folder first, a worker killed, the scheduler killed."""

import csv
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import hatch_build
from app.command_line.cli import main
from tests.app.campaign_call import Call, in_journal
from tests.app.cluster import HOUSE, LoopbackCluster, kill

pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
SHOTS = 5


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cluster")
    assert main(["--simulate", str(folder / "one"), "--shots", "1", "--seed", "4"]) == 0
    assert main(["--replay", str(folder / "one"), "--no-diagnose"]) == 0  # kernels are on disk from here on
    (folder / "shots").mkdir()
    (folder / "elsewhere").mkdir()
    for number in range(SHOTS):
        for file in (folder / "one").iterdir():
            os.link(file, folder / "shots" / f"copy-{number}{file.suffix}")
    return folder


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[LoopbackCluster]:
    running = LoopbackCluster(tmp_path)
    yield running
    running.close()


@pytest.mark.slow
def test_no_worker_wrong_folder_a_worker_killed_the_scheduler_killed(
    place: Path, cluster: LoopbackCluster, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.command_line.campaign.cluster.WORKERS_COME_S", 1.0)
    monkeypatch.chdir(place)
    over = ("--scheduler", cluster.address)
    began = time.monotonic()
    assert main(["--replay", "shots", "--export", "out", *over]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"dask worker {cluster.address}" in said
    assert time.monotonic() - began < 8

    first = cluster.worker(place / "elsewhere")
    monkeypatch.setattr("app.command_line.campaign.cluster.WORKERS_COME_S", 60.0)
    # a path that leads somewhere else for each process, as one that is mounted on this machine alone
    assert main(["--replay", "/proc/self/cwd/shots", "--export", str(place / "out"), *over]) == 1
    said = capsys.readouterr().err
    assert "does not see the folder /proc/self/cwd/shots" in said and "Traceback" not in said
    assert in_journal(place / "out") == 0

    cluster.worker(place / "elsewhere")
    call = Call("--replay", "shots", "--export", "out", *over)  # relative, and the workers stand elsewhere
    call.has_come_to(place / "out", 1)
    kill(first)
    assert call.ended() == 0
    assert f"{SHOTS} shots, {SHOTS} analysed, 0 failed\n" in capsys.readouterr().out
    with open(place / "out" / "shots.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["path"] for row in rows] == [f"shots/copy-{n}.sigmf-meta" for n in range(SHOTS)]
    assert all((place / "out" / row["motion_file"]).stat().st_size > 1000 for row in rows)

    # the other worker goes on, and this time the scheduler dies
    command = ("--replay", "shots", "--export", "again")
    call = Call(*command, "--scheduler", cluster.address)
    call.has_come_to(place / "again", 1)
    kill(cluster.scheduler)
    assert call.ended() == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "repeat the command to continue" in said
    done = in_journal(place / "again")
    assert 1 <= done < SHOTS
    assert main([*command, "--jobs", "1"]) == 0
    assert f"{SHOTS} shots, {SHOTS} analysed" in capsys.readouterr().out
    assert in_journal(place / "again") == SHOTS  # nothing was done twice


def test_workers_that_have_the_wheel_do_the_work(tmp_path: Path) -> None:
    """Driver and worker know the program as ``levimass`` alone; what they exchange says so, too."""
    site, shots, elsewhere = tmp_path / "site", tmp_path / "shots", tmp_path / "elsewhere"
    hatch_build.write_package(HOUSE, site / "levimass")
    for folder in (shots, elsewhere):
        folder.mkdir()
    (shots / "bad.sigmf-meta").write_text("{")  # refused before any kernel is needed, which would be compiled anew
    (shots / "bad.sigmf-data").write_bytes(b"")
    cluster = LoopbackCluster(tmp_path, site)
    try:
        cluster.worker(elsewhere)
        call = "import sys; from levimass import _main; sys.exit(_main(sys.argv[1:]))"
        arguments = ["--replay", str(shots), "--export", str(tmp_path / "out"), "--scheduler", cluster.address]
        ran = subprocess.run(
            [sys.executable, "-P", "-c", call, *arguments], cwd=elsewhere, check=False, capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": str(site)}, timeout=240,
        )  # fmt: skip
    finally:
        cluster.close()
    assert ran.stdout == "1 shots, 0 analysed, 1 failed\n" and "bad.sigmf-meta: not JSON" in ran.stderr, ran.stderr
    assert in_journal(tmp_path / "out") == 1
