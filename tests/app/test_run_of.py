"""What each command of the command line runs, and with what of the typed options."""

from functools import partial
from pathlib import Path

import pytest

from analysis.planning.next_shot import Reach
from app.command_line import acquire, cli, doctor, map_foreign, paper, replay, resolve, run_campaign
from app.command_line.cli import prepared_command
from app.command_line.outputs import Outputs
from app.command_line.parser import parse, settings_from
from app.command_line.replay import ReplayRequest


def _run(*argv: str) -> partial:
    found = prepared_command(parse(list(argv)), argv)
    assert isinstance(found, partial)
    return found


def test_a_bare_replay_diagnoses_and_writes_nothing() -> None:
    found = _run("replay", "x", "y")
    assert found.func is replay.replay
    assert found.args == ([Path("x"), Path("y")], ReplayRequest(), Outputs())
    assert found.keywords == {"model": None, "settings": settings_from(parse(["replay", "x"])), "checked": True}


def test_a_replay_does_what_was_typed() -> None:
    files = ("--json", "-", "--export", "csv", "--hdf5", "--report", "r.html", "--save-model", "m.toml")
    found = _run("replay", "x", *files, "--law", "a.toml", "--law", "b.toml", "--unchecked", "--model", "clamped")
    _, request, outputs = found.args
    assert outputs == Outputs("-", Path("csv"), True, Path("r.html"), Path("m.toml"))
    assert request == ReplayRequest(laws=(Path("a.toml"), Path("b.toml")))
    assert found.keywords["checked"] is False and found.keywords["model"] == "clamped"
    assert _run("replay", "x", "--no-diagnose").args[1] == ReplayRequest(diagnosis=False)
    assert _run("replay", "x", "--model", "m.toml", "--foretell").args[1].test_model


def test_shots_are_planned_within_what_the_rig_can_do() -> None:
    request = _run("plan", "x", "--speeds", "0.1,0.4", "--weights", "0.05", "--run-up", "0.02").args[1]
    assert (request.plan, request.reach) == ("", Reach((0.1, 0.4), (0.0, 0.05), 0.02))
    assert _run("replay", "x").args[1].reach is None


def test_a_campaign_has_its_workers() -> None:
    found = _run("replay", "x", "--jobs", "3", "--json", "out.json")
    assert found.func is run_campaign.campaign
    assert found.args == ([Path("x")], Outputs("out.json"))
    assert found.keywords.items() >= {"jobs": 3, "scheduler": None, "insecure": False}.items()
    of_scheduler = _run("replay", "x", "--scheduler", "tcp://127.0.0.1:1").keywords
    assert of_scheduler.items() >= {"jobs": None, "scheduler": "tcp://127.0.0.1:1", "insecure": False}.items()
    assert _run("replay", "x", "--scheduler", "tcp://127.0.0.1:1", "--insecure").keywords["insecure"]


def test_shots_are_acquired_from_the_source_where_it_stands() -> None:
    typed = ("--source", "bench?seed=3", "--out", "there", "--rate", "2e6", "--samples", "1000", "--timeout", "7")
    found = _run("acquire", "4", *typed)
    assert found.func is acquire.acquire
    assert found.args == (4, acquire.CaptureRequest("bench?seed=3", Path("there"), 2e6, 1000, 7.0))
    sited = _run("acquire", "4", *typed, "--site", "VC-A").args[1]
    assert "VC-A" in sited.source and "seed=3" in sited.source
    found = _run("acquire", "4", *typed, "--resolve", "2", "--json", "o.json", "--speeds", "0.2")
    assert found.func is resolve.resolve
    assert found.args[:2] == (4, 2) and found.args[2].samples == 1000
    assert found.args[3] == "o.json" and found.args[4].speeds_m_per_s == (0.2,)


def test_shots_are_simulated_as_typed() -> None:
    typed = ("--shots", "5", "--seed", "9", "--effect", "quadratic_drag", "--site", "VC-D")
    found = _run("simulate", "there", *typed)
    assert found.func is acquire.simulate and found.args == (Path("there"),)
    assert found.keywords == {"shots": 5, "seed": 9, "effect": "quadratic_drag", "undeclared": False, "site": "VC-D"}
    assert _run("simulate", "there", "--undeclared").keywords["undeclared"] is True


def test_a_foreign_file_is_mapped_as_typed() -> None:
    numbers = ("--mass", "0.018", "--rest", "2.7e6", "--wavelength", "6.3e-7", "--bits", "12", "--rate", "1e6")
    found = _run("map", "f.tdms", *numbers, "--for-folder")
    assert found.func is map_foreign.map_foreign and found.args[0] == Path("f.tdms")
    chosen = found.args[3]
    assert chosen == map_foreign.MapOptions(0.018, 1e6, 2.7e6, 6.3e-7, 12, chosen.unit, chosen.model)
    assert found.keywords == {"for_folder": True}


def test_the_papers_numbers_the_kernels_and_the_machine() -> None:
    assert _run("paper", "x", "--json", "o").args == ("o", None, Path("x"))
    assert _run("paper").func is paper.paper and _run("paper").args[2] is None
    assert _run("prepare", "--jobs", "3").args == (3,) and _run("prepare").func is doctor.prepare
    found = _run("doctor", "--source", "bench", "--bundle", "b.zip")
    assert found.func is doctor.doctor and found.keywords == {"source": "bench", "bundle": Path("b.zip")}


def test_the_window_is_opened_where_the_bench_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    found = _run("window", "--site", "VC-B")
    assert found.func is cli.window and found.args == (("window", "--site", "VC-B"),)
    assert found.keywords == {"site": "VC-B"}
