"""A campaign gives what one process gives, is taken up where it stopped, and survives bad shots."""

import contextlib
import csv
import gc
import hashlib
import io
import json
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.shot.shot import AnalysisSettings
from analysis.shot.version import program_version, version_and_digest
from app.command_line import run_campaign
from app.command_line.campaign.cluster import _client, is_secure
from app.command_line.campaign.journal import JOURNAL, Journal
from app.command_line.campaign.task import NotReached, analyse_one, tasks_of, why_unusable
from app.command_line.campaign.worker_pool import ProcessPool, WorkersLost, most_processes
from app.command_line.cli import main
from app.report.exports import shot_columns
from tests.app.deadly import DEADLY, unless_deadly


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaign")
    assert main(["--simulate", str(folder / "a"), "--shots", "2", "--seed", "1"]) == 0
    assert main(["--simulate", str(folder / "b"), "--shots", "2", "--seed", "2"]) == 0
    (folder / "b" / "shot-3.sigmf-meta").write_text("{")
    (folder / "b" / "shot-3.sigmf-data").write_bytes(b"")
    return folder


def _without_times(shot: dict[str, Any]) -> dict[str, Any]:
    # a budget's repeatability comes from the other shots of one call; a campaign's shots stand alone
    return {key: value for key, value in shot.items() if key not in ("seconds", "budget")}


def test_as_one_process_and_resumed(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, alone = tmp_path / "out", tmp_path / "alone.json"
    assert main(["--replay", str(shots), "--no-diagnose", "--json", str(alone)]) == 1
    arguments = ["--replay", str(shots), "--jobs", "2", "--export", str(out), "--json", str(tmp_path / "all.json")]
    assert main(arguments) == 1
    assert "5 shots, 4 analysed, 1 failed" in capsys.readouterr().out
    one, many = (json.loads(path.read_text()) for path in (alone, tmp_path / "all.json"))
    assert [_without_times(s) for s in many["shots"]] == [_without_times(s) for s in one["shots"]]
    with open(out / "shots.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["ok", "ok", "ok", "ok", "failed"]
    files = [row["motion_file"] for row in rows[:4]]
    assert len(set(files)) == 4
    assert all((out / name).exists() for name in files)

    # a crash in the middle: the last line of the journal is half there
    journal = out / JOURNAL
    lines = journal.read_text().splitlines()
    journal.write_text("\n".join(lines[:3]) + "\n" + lines[3][:50])
    times = {name: (out / name).stat().st_mtime_ns for name in files}
    assert main([*arguments, "--jobs", "1"]) == 1  # however many there are, what is done stays done
    again = {name: (out / name).stat().st_mtime_ns for name in files}
    assert sum(times[name] == again[name] for name in files) in (2, 3)  # those of the whole lines were not done again
    resumed = json.loads((tmp_path / "all.json").read_text())
    assert [_without_times(s) for s in resumed["shots"]] == [_without_times(s) for s in one["shots"]]


def test_a_scheduler_that_does_not_answer(
    shots: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    monkeypatch.setattr("app.command_line.campaign.cluster.SCHEDULER_ANSWERS_S", 0.5)
    assert main(["--replay", str(shots / "a"), "--scheduler", "tcp://127.0.0.1:9"]) == 1
    assert "127.0.0.1:9" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("tls://127.0.0.1:9", "TLS needs a certificate of your own"),
        ("tcp://127.0.0.1:port", "is not a scheduler address"),
        ("inproc://here", "is not a scheduler address"),
        ("TCP://127.0.0.1:9", "is not a scheduler address"),
    ],
)
def test_a_scheduler_that_cannot_be_connected_to_is_said_in_one_line(
    shots: Path, capsys: pytest.CaptureFixture[str], address: str, words: str
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    before = _clients(distributed)
    assert main(["--replay", str(shots / "a"), "--scheduler", address]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith(f"levimass: {address}: ") and words in said
    # one that ended while the next one begins would wait for a lock that the next one holds
    assert _clients(distributed) <= before


def _clients(distributed: Any) -> int:
    return sum(isinstance(one, distributed.Client) for one in gc.get_objects())


def test_an_incomplete_client_is_deleted_although_its_thread_still_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine the thread that tells why it could not connect is late to end what it is doing."""
    distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")

    class Told(threading.Event):
        def set(self) -> None:
            super().set()
            time.sleep(0.05)

    monkeypatch.setattr("distributed.utils.threading", SimpleNamespace(**{**vars(threading), "Event": Told}))
    before = _clients(distributed)
    with pytest.raises(WorkersLost):
        _client("tcp://127.0.0.1:port")
    assert _clients(distributed) <= before


def test_what_was_not_reached_is_no_result(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A data file that is not there yet is told, counted apart, and tried again by the next call."""
    folder = tmp_path / "late"
    folder.mkdir()
    (source,) = (shots / "a").glob("*-1.sigmf-meta")
    (folder / "late.sigmf-meta").write_bytes(source.read_bytes())
    command = ["--replay", str(folder), "--jobs", "1", "--export", str(tmp_path / "out")]
    assert main(command) == 1
    heard = capsys.readouterr()
    assert "1 shots, 0 analysed, 0 failed, 1 not reached" in heard.out and "no such file" in heard.err
    (folder / "late.sigmf-data").write_bytes(source.with_suffix(".sigmf-data").read_bytes())
    assert main(command) == 0


def test_a_worker_that_cannot_do_the_work_says_why(tmp_path: Path) -> None:
    here = str(tmp_path)
    assert why_unusable(version_and_digest(), [here], here) is None and list(tmp_path.iterdir()) == []
    assert why_unusable("another", [here], here) == f"has levimass {version_and_digest()}, not another"
    assert why_unusable(version_and_digest(), [here, here + "/none"], None) == f"does not see the folder {here}/none"
    (tmp_path / "a file").touch()
    assert f"cannot write to {here}/a file" in str(why_unusable(version_and_digest(), [here], f"{here}/a file"))


def test_a_terminal_is_told_how_many_shots_are_done_and_how_long_the_others_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [100.0]
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(run_campaign.time, "monotonic", lambda: now[0])
    progress = run_campaign.ProgressLine(10, already=7)
    for _ in range(4):
        now[0] += 3.0
        progress.step()
    progress.end()
    assert "7 shots were analysed by an earlier call" in terminal.getvalue()
    lines = [line for line in terminal.getvalue().split("\r") if "s left" in line]
    assert [line.split(" \x1b")[0] for line in lines] == [
        f"{done}/10 shots, {left} s left" for done, left in ((1, 27), (2, 24), (3, 21), (4, 18))
    ]
    terminal.truncate(0)
    monkeypatch.setattr(terminal, "isatty", lambda: False)
    quiet = run_campaign.ProgressLine(2, already=1)
    quiet.step()
    quiet.end()
    assert terminal.getvalue() == ""


def test_windows_waits_for_61_processes_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.command_line.campaign.worker_pool._MOST", most_processes("win32"))
    pool = ProcessPool(200)
    pool.close()
    assert pool.width == 61 and most_processes("linux") > 200


def test_a_process_that_dies_is_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shots under way with one that kills its process are analysed all the same; the killer is told and no result."""
    pool = ProcessPool(2)
    try:
        monkeypatch.setattr("app.command_line.campaign.worker_pool.analyse_one", unless_deadly)
        tasks = tasks_of([Path("a"), Path(DEADLY), Path("b")], None, AnalysisSettings(), None)
        for task in tasks:
            pool.give(task)
        outcomes: dict[str, Any] = {}
        while len(outcomes) < 3:
            outcomes |= {task.path: outcome for task, outcome in pool.take()}
    finally:
        pool.close()
    assert outcomes[DEADLY] == NotReached("the process that analysed it died")
    assert all(outcomes[task.path]["shot"]["path"] == task.path for task in (tasks[0], tasks[2]))


def test_a_campaign_that_did_not_look_at_the_hash_is_no_answer_to_one_that_does(shots: Path, tmp_path: Path) -> None:
    (meta,) = (shots / "a").glob("*-1.sigmf-meta")
    data = meta.with_suffix(".sigmf-data")
    stem = tmp_path / "altered"
    stem.with_suffix(".sigmf-meta").write_bytes(meta.read_bytes())
    octets = bytearray(data.read_bytes())
    octets[-2] ^= 1
    stem.with_suffix(".sigmf-data").write_bytes(octets)
    found = [stem.with_suffix(".sigmf-meta")]
    (left,), (looked,) = (tasks_of(found, None, AnalysisSettings(), None, checked=checked) for checked in (False, True))
    assert left.stamp != looked.stamp
    for task, said in ((left, False), (looked, True)):
        entry = analyse_one(task)
        assert not isinstance(entry, NotReached) and ("data_altered" in entry["shot"]["flags"]) is said


ENTRY = {
    "stamp": "s", "shot": {"status": "ok", "problem": None, "flags": [], "x": 1.5}, "row": [""] * len(shot_columns()),
}  # fmt: skip


def _journal_of(path: Path, *entries: dict[str, Any]) -> None:
    with contextlib.closing(Journal(path, ())) as journal:
        for entry in entries:
            journal.add(entry)


def _forged(entry: dict[str, Any], **change: Any) -> bytes:
    """Return a line with the checksum of what it says, as somebody writes it who has read how."""
    text = json.dumps({**entry, **change}).encode()
    return b'{"sha256": "' + hashlib.sha256(text).hexdigest().encode() + b'", "entry": ' + text + b"}\n"


def test_a_line_of_a_journal_is_served_as_it_was_written_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    _journal_of(path, ENTRY)
    whole = path.read_bytes()
    with contextlib.closing(Journal(path, {"s"})) as journal:
        assert journal.entry("s") == ENTRY and journal.unreadable_lines == 0
    assert _forged(ENTRY) == whole
    shot = ENTRY["shot"]
    for line in (
        json.dumps(ENTRY).encode() + b"\n",  # as earlier versions wrote them
        whole.replace(b"1.5", b"2.5"),
        whole.replace(b'"s"', b'"t"', 1).replace(b"1.5", b"1.50"),
        whole[:-3] + b"\n",
        _forged(ENTRY, row=[]),
        _forged(ENTRY, row=[1.0] * len(shot_columns())),
        _forged(ENTRY, row="x" * len(shot_columns())),
        _forged(ENTRY, shot=[]),
        _forged(ENTRY, shot={**shot, "x": float("nan")}),
        _forged(ENTRY, shot={**shot, "x": 1e999}),
        _forged(ENTRY, shot={**shot, "flags": None}),
        b"null\n",
        b"[" * 100_000 + b"\n",
        b"\xff\xfe\n",
    ):
        path.write_bytes(line)
        with contextlib.closing(Journal(path, {"s", "t"})) as journal:
            assert "s" not in journal and "t" not in journal and journal.unreadable_lines == 1, line[:200]


def test_a_spoilt_line_costs_its_shot_and_a_sentence(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["--replay", str(shots / "a"), "--jobs", "1", "--json", str(tmp_path / "all.json")]
    assert main(command) == 0
    whole = json.loads((tmp_path / "all.json").read_text())
    journal = tmp_path / "all.json.journal"
    first, second = journal.read_bytes().splitlines(keepends=True)
    velocity = whole["shots"][0]["velocity_in_m_per_s"]["value"]
    journal.write_bytes(first.replace(repr(velocity).encode(), b"-0.5") + second)
    capsys.readouterr()
    assert main(command) == 0
    heard = capsys.readouterr().err
    assert "all.json.journal: a line is damaged and ignored" in heard and "Traceback" not in heard
    again = json.loads((tmp_path / "all.json").read_text())
    assert [_without_times(s) for s in again["shots"]] == [_without_times(s) for s in whole["shots"]]


def test_a_changed_program_of_the_same_version_does_not_serve_old_numbers(
    shots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = sorted((shots / "a").glob("*.sigmf-meta"))
    before = [task.stamp for task in tasks_of(found, None, AnalysisSettings(), None)]
    assert before == [task.stamp for task in tasks_of(found, None, AnalysisSettings(), None)]
    monkeypatch.setattr("app.command_line.campaign.task.version_and_digest", lambda: f"{program_version()} (another)")
    assert not set(before) & {task.stamp for task in tasks_of(found, None, AnalysisSettings(), None)}
    assert version_and_digest().startswith(program_version()) and len(version_and_digest()) > len(program_version())


SAFE = (
    "127.0.0.1:8786", "tcp://127.0.0.1:8786", "tcp://localhost:8786", "tcp://[::1]:8786", "tls://10.1.2.3:8786",
    "TLS://lab:8786", "inproc://10.1.2.3/7/1", "127.9.9.9:1",
)  # fmt: skip
UNSAFE = (
    "tcp://10.1.2.3:8786", "10.1.2.3:8786", "tcp://lab:8786", "lab", "", "ucx://10.1.2.3:8786", "tcp://[fe80::1]:8786",
    "ws://10.1.2.3:80", "tcp://127.0.0.1.evil.org:8786", "tcp://127.0.0.1@10.1.2.3:8786", "tcp://0.0.0.0:8786",
    "tcp://10.1.2.3@localhost:8786",
)  # fmt: skip


@pytest.mark.parametrize(("address", "safe"), [*((a, True) for a in SAFE), *((a, False) for a in UNSAFE)])
def test_a_scheduler_elsewhere_without_tls_is_refused(
    shots: Path, capsys: pytest.CaptureFixture[str], address: str, safe: bool
) -> None:
    assert is_secure(address) is safe
    if not safe:
        pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
        assert main(["--replay", str(shots / "a"), "--scheduler", address]) == 1
        heard = capsys.readouterr().err
        assert "--insecure" in heard and heard.count("\n") == 1


def test_who_insists_is_let(shots: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    monkeypatch.setattr("app.command_line.campaign.cluster.SCHEDULER_ANSWERS_S", 0.3)
    assert main(["--replay", str(shots / "a"), "--scheduler", "tcp://192.0.2.1:9", "--insecure"]) == 1
    assert "--insecure" not in capsys.readouterr().err  # nobody is there, which is another thing
    assert main(["--replay", str(shots / "a"), "--insecure"]) == 2
