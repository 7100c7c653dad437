"""What commands accept, refuse, print and write, against what is written down in ``written/``; slow work is given."""

import argparse
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Errors, PredictedShot, PredictionTest
from analysis.planning.next_shot import NextShot, Reach
from analysis.planning.plan import Plan
from analysis.planning.shot_log import PlanningState
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError, AnalysisSettings
from app.command_line import acquire, doctor, machine, outputs, replay, resolve
from app.command_line.cli import main, prepared_command, reach_of
from app.command_line.options import COMMANDS, PLAN, WINDOW
from app.command_line.outputs import Outputs, check_outputs, error_line, problem_line
from app.command_line.parser import command_of, command_parser, flat_parser, parse, settings_from
from app.command_line.replay import ReplayRequest
from app.session.model_in_use import write_model
from instrument.devices.digitizer import DigitizerError
from instrument.devices.doctor import Check, Grade
from instrument.files.recording_error import RecordingError
from tests.app import synthetic
from tests.app.window.scene import check

KEPT = Path(__file__).parent / "written"
DRAG, VISCOUS, TILT = effects_named(("quadratic_drag", "viscous_drag", "tilt"))


def _takes(parser: argparse.ArgumentParser) -> list[str]:
    """Return a line for each option of a parser: flags, value, default, help."""
    lines = []
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction):
            continue
        flags = ", ".join(action.option_strings) or action.dest
        given = f" {action.metavar}" if action.metavar else ""
        how = f" nargs {action.nargs}" if action.nargs is not None else ""
        more = f", default {action.default}" if action.default not in (None, False, argparse.SUPPRESS) else ""
        many = ", may be repeated" if isinstance(action, argparse._AppendAction) else ""
        words = (action.help or "").replace("%(later)s", "SOURCES")
        lines.append(f"{flags}{given}{how}{more}{many}: {words}")
    return lines


def test_what_each_command_takes():
    parts = {name: _takes(command_parser(name)) for name in (*(c.key for c in COMMANDS), PLAN, WINDOW)}
    parts["about each"] = [f"{command_parser(name).prog}: {command_parser(name).description}" for name in parts]
    parts["all as options"] = [line.partition(":")[0] for line in _takes(flat_parser())]
    parts["groups"] = [str(group.title) for group in flat_parser()._action_groups[2:]]
    check("options", parts, KEPT)


def _words(value):
    """Return what a command would run with, in words."""
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, partial):
        named = [f"{key}={_words(given)}" for key, given in value.keywords.items()]
        return f"{value.func.__name__}({', '.join([*map(_words, value.args), *named])})"
    if isinstance(value, list):
        return f"[{', '.join(map(_words, value))}]"
    return repr(value).replace("PosixPath", "Path").replace("WindowsPath", "Path")


CALLS = (
    "replay a b --json - --no-diagnose --unchecked",
    "replay a --fit-seconds 3 --diagnosis-seconds 9 --model clamped",
    "replay a --export d --hdf5 --report r.html --save-model m.toml --law l.toml --law k.toml",
    "replay a --model m.toml --foretell --plan plate_mass_kg --speeds 0.3,0.1,0.3 --weights 0.05 --run-up 0.02",
    "replay a --jobs 3 --export d",
    "replay a --scheduler tcp://b:8786 --insecure",
    "plan a",
    "plan a --weights 0",
    "acquire 2 --source bench --out d --rate 5e6 --samples 1000 --timeout 7",
    "acquire 2 --source bench --out d --site VC-C --resolve 3 --json r.json --speeds 0.2",
    "acquire 1 --source hantek6022 --out d",
    "simulate d",
    "simulate d --shots 2 --seed 9 --effect tilt:angle_rad=1e-4 --site VC-D",
    "simulate d --undeclared",
    "map f.csv --channel measurement=a --channel switch=b --volts measurement=2 --mass 0.02 --rate 1e6 --rest 2.7e6",
    "map f.csv --channel displacement=x --unit mm --model contact --wavelength 6.3e-7 --bits 12 --for-folder",
    "paper",
    "paper shot --json - --figures d",
    "prepare --jobs 2",
    "doctor --source bench --bundle b.zip",
)
REFUSED = (
    "replay", "replay x --seed 2", "plan x --no-diagnose", "acquire 1 --source bench", "doctor --json -", "simulate",
    "--replay x --hdf5", "--replay x --insecure", "--replay x --speeds 0.1", "--replay x --plan --speeds 0,0.1",
    "--replay x --plan --weights -1", "--replay x --plan --weights a", "--replay x --plan --run-up 0",
    "--acquire 0 --source bench --out d", "--acquire 1 --source bench --out d --rate 0",
    "--acquire 1 --source bench --out d --json r", "--acquire 1 --source hantek6022 --out d --site VC-C",
    "--simulate d --undeclared --effect tilt:angle_rad=1", "--simulate d --site VC-Z", "--simulate d --seed -1",
    "--replay x --jobs 2 --scheduler s", "--replay x --jobs 2 --report r", "--replay x --law l --no-diagnose",
    "--replay x --save-model m --no-diagnose", "--replay x --plan --no-diagnose", "--replay x --model none",
    "--replay x --diagnosis-seconds 9 --jobs 2", "--replay x --foretell --model paper", "--replay x --fit-seconds 0",
    "--figures d", "--replay x --doctor", "--bits 12",
)  # fmt: skip


def test_what_a_call_runs(monkeypatch):
    parts = {}
    usual = vars(flat_parser().parse_args([]))
    for call in CALLS:
        options = parse(call.split())
        given = {name: value for name, value in vars(options).items() if value != usual.get(name)}
        said = [f"{name} = {_words(value)}" for name, value in sorted(given.items())]
        runs = _words(prepared_command(options, call.split()))
        parts[call] = [f"command {command_of(options)}", *said, f"runs {runs}"]
    check("calls", parts, KEPT)
    assert command_of(parse([])) == WINDOW == command_of(parse(["--site", "VC-D"]))
    assert settings_from(parse(["--replay", "a"])) == AnalysisSettings()
    assert reach_of(parse(["plan", "a"])) == Reach()


def test_why_a_call_is_refused(capsys):
    said = []
    for call in REFUSED:
        assert main(call.split()) == 2
        (line,) = [line for line in capsys.readouterr().err.splitlines() if ": error: " in line]
        said.append(f"{call}  ->  {re.sub('^levimass.*?: error: ', '', line)}")
    check("refused", {"calls": said}, KEPT)


@pytest.fixture
def shots(monkeypatch):
    """Let a replay find shots that are given; return their list and what was asked of whom."""
    found, asked = [], []

    def loaded(path, model, *, settings, checked):
        shot = next(shot for shot in found if shot.name == path.stem)
        asked.append(f"load {path.name}: model {model}, {[e.name for e in settings.effects]}, checked {checked}")
        return replace(shot, path=str(path), settings=replace(shot.settings, effects=settings.effects))

    def diagnosed(chosen, *, accepted, laws, seconds):
        asked.append(
            f"diagnose {[s.name for s in chosen]}, {[e.name for e in accepted]}, {len(laws)} laws, {seconds} s"
        )
        return replace(synthetic.diagnosis(chosen[0]), not_asked=("laws",))

    monkeypatch.setattr(replay, "load_and_analyse", loaded)
    monkeypatch.setattr(replay, "diagnose", diagnosed)
    monkeypatch.setattr(replay, "read_together", lambda shots, fit: list(shots))
    monkeypatch.setattr(replay, "find_recordings", lambda paths: paths)
    return found, asked


def _run(capsys, paths, request, out, **how):
    """Return status and what was printed."""
    how = {"model": None, "settings": AnalysisSettings()} | how
    status = replay.replay(paths, request, out, **how)
    printed = capsys.readouterr()
    return [f"status {status}", *printed.out.splitlines(), *(f"error: {line}" for line in printed.err.splitlines())]


LEFT_OUT = ("budget", "program", "settings", "series", "version", "packages")  # other tests have them


def _short(value):
    """Return a result without its budgets, numbers to six digits."""
    if isinstance(value, dict):
        return {key: _short(given) for key, given in value.items() if key not in LEFT_OUT}
    if isinstance(value, list):
        return [_short(given) for given in value[:4]]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def test_a_replay_prints_and_writes_what_was_found(shots, capsys, tmp_path, monkeypatch):
    found, asked = shots
    unfitted = replace(synthetic.shot("c", 0.3, 1), fit=None, fit_problem="too slow")
    found += [
        synthetic.shot("a", 0.265, 1), synthetic.shot("b", 0.2, 2), unfitted,
        synthetic.shot("d", 0.3, 1, problem="no impact was found"),
    ]  # fmt: skip
    paths = [tmp_path / f"{shot.name}.csv" for shot in found]
    parts = {}

    def noted(lines):
        said, asked[:] = list(asked), []
        return [line.replace(str(tmp_path), "FOLDER") for line in (*said, *lines)]

    everything = Outputs(str(tmp_path / "r.json"), tmp_path / "csv", True, tmp_path / "r.html", tmp_path / "m.toml")
    parts["two shots, all outputs"] = noted(_run(capsys, paths[:2], ReplayRequest(), everything))
    parts["files"] = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*"))
    written = json.loads((tmp_path / "r.json").read_text())
    parts["result"] = (
        json.dumps(_short(written), indent=1, ensure_ascii=False).replace(str(tmp_path), "FOLDER").splitlines()
    )
    parts["only the fit"] = noted(_run(capsys, paths[2:3], ReplayRequest(diagnosis=False), Outputs()))
    parts["one that failed"] = noted(_run(capsys, paths[3:], ReplayRequest(), Outputs()))
    parts["none"] = noted(_run(capsys, [], ReplayRequest(), Outputs()))
    parts["an output that cannot be"] = noted(_run(capsys, paths[:1], ReplayRequest(), Outputs(report=tmp_path)))
    out = _run(capsys, paths[:1], ReplayRequest(diagnosis=False), Outputs("-"), checked=False)
    assert json.loads("\n".join(out[1:]))["shots"][0]["name"] == "a" and out[0] == "status 0"
    parts["unchecked"] = noted([])
    model = tmp_path / "known.toml"
    fit = found[0].fit
    drag = {f"{DRAG.key}.coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    fit = replace(fit, effects=(DRAG,), parameters=fit.parameters | drag, covariance=np.eye(5))
    far = replace(fit.parameters["plate_mass_kg"], value=3e-4)
    write_model(model, replace(fit, parameters=fit.parameters | {"plate_mass_kg": far}), found[:1], None, (DRAG,))
    errors = Errors(62e-9, 40e-6, 3.1e-3, 3800.0), Errors(1.1e-9, 8e-6, 2e-3, 1.01)
    tested = (PredictedShot("a", True, *errors), PredictedShot("b", False, None, None, "no motion"))
    monkeypatch.setattr(replay, "predicted", lambda *_: PredictionTest("paper", (DRAG,), *errors, tested))
    parts["a model file, tested"] = noted(
        _run(capsys, paths[:2], ReplayRequest(test_model=True), Outputs(), model=str(model))
    )
    parts["a model file that is not there"] = noted(
        _run(capsys, paths[:1], ReplayRequest(), Outputs(), model="no.toml")
    )

    def fails(*_, **__):
        raise AnalysisError("it does not end")

    def broken(*_, **__):
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr(replay, "diagnose", fails)
    parts["no diagnosis"] = noted(_run(capsys, paths[:1], ReplayRequest(), Outputs(model=tmp_path / "n.toml")))
    monkeypatch.setattr(replay, "diagnose", broken)
    parts["a fault of the program"] = noted(_run(capsys, paths[:1], ReplayRequest(), Outputs()))
    parts["two kinds of base"] = noted([])
    found.append(synthetic.driven_shot("e"))
    parts["two kinds of base"] = noted(_run(capsys, [paths[0], tmp_path / "e.csv"], ReplayRequest(), Outputs()))
    check("replay", parts, KEPT)


def test_the_next_shots_are_planned_from_a_diagnosis(shots, capsys, tmp_path, monkeypatch):
    found, _ = shots
    found.append(synthetic.shot("a", 0.265, 1))
    fast = NextShot(0.6, 0.05, 0.012, 0.02)
    plan = Plan((fast,), (DRAG, VISCOUS), 2.0, {DRAG: 9.0, VISCOUS: 8.1}, {DRAG: 9.0, VISCOUS: 8.1}, 9.0, ())
    states = {"open": PlanningState(plan), "decided": PlanningState(None)}
    parts = {}
    for name, state in states.items():
        monkeypatch.setattr(replay, "plan_next", lambda shots, diagnosis, *, reach, state=state: state)
        out = Outputs(str(tmp_path / f"{name}.json"))
        parts[name] = _run(capsys, [tmp_path / "a.csv"], ReplayRequest(plan=""), out)
        parts[name].append(f"next_shots {json.loads((tmp_path / f'{name}.json').read_text())['next_shots']}")
    parts["without a diagnosis"] = _run(capsys, [tmp_path / "a.csv"], ReplayRequest(False, plan=""), Outputs())
    check("planned", {n: [x.replace(str(tmp_path), "FOLDER") for x in lines] for n, lines in parts.items()}, KEPT)


def test_the_doctor_prints_its_checks_and_fails_with_them(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "check_computer", lambda _: (Check("disk", Grade.WARN, "1 GB free"),))
    monkeypatch.setattr(doctor, "why_no_window", lambda: "no display")
    monkeypatch.setattr(doctor, "complete", lambda: False)
    kernels = tmp_path / "kernels"
    (kernels / "a").mkdir(parents=True)
    (kernels / "a" / "k.nbi").write_bytes(b"x" * 2_600_000)
    (kernels / "a" / "other").write_bytes(b"x" * 9_000_000)
    monkeypatch.setattr(doctor, "cache_folder", lambda: kernels)
    monkeypatch.setattr(doctor, "installed", lambda _: "1.2.3")

    class Signals:
        closed = 0

        def close(self):
            Signals.closed += 1

    def tried(_):
        return [Check("PD0", Grade.FAIL, "no beat")]

    monkeypatch.setattr(doctor, "open_in_subprocess", lambda source: Signals())
    monkeypatch.setattr(doctor, "try_signals", tried)
    parts = {}

    def said(status):
        lines = [line.replace(str(kernels), "KERNELS") for line in capsys.readouterr().out.splitlines()]
        return [f"status {status}", *(re.sub(r"(?<=, in )/.*|/.*log.*", "FOLDER", line) for line in lines)]

    parts["without a source"] = said(doctor.doctor(tmp_path))
    monkeypatch.setattr(doctor, "why_no_window", lambda: None)
    monkeypatch.setattr(doctor, "complete", lambda: True)
    parts["with one"] = said(doctor.doctor(tmp_path, "bench"))
    assert Signals.closed == 1

    def refused(_):
        raise DigitizerError("not found", "plug it in")

    monkeypatch.setattr(doctor, "open_in_subprocess", refused)
    parts["one that is not there"] = said(doctor.doctor(tmp_path, "bench"))
    assert doctor.prepare() == 0
    parts["prepared"] = said(0)
    monkeypatch.setattr(doctor, "complete", lambda: False)
    asked = []
    monkeypatch.setattr(doctor, "compile_all", lambda report, stop, at_once: asked.append((stop(), at_once)) or False)
    assert doctor.prepare(3) == 1 and asked == [(False, 3)]
    assert "not all kernels could be compiled" in capsys.readouterr().err
    check("doctor", parts, KEPT)


def test_progress_is_a_line_for_each_step_that_differs(capsys):
    report = doctor.progress_lines()
    for words, share in (("a", 0.0), ("a", 0.001), ("a", 0.5), ("b", 0.5), ("b", 0.5)):
        report(words, share)
    assert capsys.readouterr().err.splitlines() == ["  0 %  a", " 50 %  a", " 50 %  b"]


def test_paths_of_the_user_are_hidden_the_longest_first(monkeypatch, tmp_path):
    home = tmp_path / "home" / "ada"
    inner = home / "real"
    inner.mkdir(parents=True)
    monkeypatch.setattr(doctor.Path, "home", lambda: home)
    monkeypatch.setattr(doctor.os.path, "realpath", lambda _: str(inner))
    monkeypatch.setattr(doctor, "_user", lambda: "ada")
    text = f"{inner}/a {home}/b /mnt/ada/c /mnt/adam/d ada"
    assert doctor._anonymous(text) == "~/a ~/b /mnt/~/c /mnt/adam/d ada"


def test_why_no_window_opens(monkeypatch):
    class Ended:
        def __init__(self, status, said=""):
            self.returncode, self.stderr = status, said

    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(machine.os, "name", "posix")
    monkeypatch.setattr(machine.sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    assert machine.why_no_window() == "no display"
    remedy = f"on Debian: apt install {machine.QT_LIBRARIES}"
    answers = {
        Ended(0): None,
        Ended(1, "first\nno plugin\n\n"): f"Qt does not start: no plugin; {remedy}",
        Ended(-6): f"Qt does not start: status -6; {remedy}",
    }
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        with monkeypatch.context() as patch:
            patch.setenv(name, ":0")
            for ended, said in answers.items():
                patch.setattr(machine.subprocess, "run", lambda *_, ended=ended, **__: ended)
                assert machine.why_no_window() == said
    monkeypatch.setattr(machine.sys, "platform", "darwin")
    monkeypatch.setattr(machine.importlib.util, "find_spec", lambda _: None)
    assert machine.why_no_window() == "PySide6 is not installed"


def test_errors_are_one_line_with_the_file_in_it(tmp_path, capsys):
    path = tmp_path / "x.csv"
    assert error_line(PermissionError(13, "denied", "/y"), path) == "/y: denied"
    assert error_line(OSError("gone"), "z") == "z: gone"
    assert error_line(AnalysisError("why"), "z") == "z: why" and "x.csv: why" in error_line(
        RecordingError(path, "why"), "z"
    )
    assert problem_line("/a/b.csv", "b.csv: spoilt") == "b.csv: spoilt" and problem_line("/a/b", "no") == "/a/b: no"
    assert error_line(ValueError("a\n b"), "z") == "z: a fault of the program: ValueError: a b"
    check_outputs("-", None, None)
    check_outputs(str(tmp_path / "r.json"), tmp_path / "new" / "er", tmp_path / "r.html")
    assert (tmp_path / "new" / "er").is_dir()
    check_outputs(None, tmp_path / "new" / "er")
    for broken in ((str(tmp_path), None), (None, None, tmp_path)):
        with pytest.raises((RecordingError, OSError)):
            check_outputs(*broken)
    outputs.say_problem(synthetic.shot("run-1", problem="no impact"))
    outputs.say_problem(replace(synthetic.shot("run-2"), fit_problem="slow"))
    outputs.say_problem(synthetic.shot("u"))
    outputs.write_json("{}\n", "-")
    printed = capsys.readouterr()
    assert printed.err.splitlines() == ["levimass: run-1: no impact", "levimass: run-2: not fitted: slow"]
    assert printed.out == "{}\n"


def test_shots_are_taken_until_the_plan_is_settled(capsys, monkeypatch, tmp_path):
    fast = NextShot(0.6, 0.05, 0.012, 0.02)
    plan = Plan((fast,), (DRAG, VISCOUS), 2.0, {DRAG: 9.0, VISCOUS: 8.1}, {DRAG: 9.0, VISCOUS: 8.1}, 9.0, ())
    asked = []

    def planned(shots, diagnosis, steps, *, left, reach):
        asked.append((len(shots), len(steps), left, reach))
        done = tuple(replace(step, reached=7.4) for step in steps)
        return PlanningState(plan if len(steps) < 2 else None, done)

    monkeypatch.setattr(resolve, "plan_next", planned)
    monkeypatch.setattr(resolve, "diagnose", lambda shots: synthetic.diagnosis(shots[0]))
    monkeypatch.setattr(resolve, "load_and_analyse", lambda path: replace(synthetic.shot(path.stem), path=str(path)))
    monkeypatch.setattr(resolve, "record_shots", lambda count, request: [tmp_path / f"s{n}.x" for n in range(count)])
    opened = []
    monkeypatch.setattr(
        resolve, "opened", lambda source, request: opened.append(source) or type("D", (), {"setup": None})
    )
    monkeypatch.setattr(resolve, "planned_setup", lambda setup, shot, shots: ("setup", shot.speed_m_per_s, len(shots)))
    taken = []

    def took(digitizer, out, count, settings, timeout_s, *, report, setup):
        taken.append((count, settings.sample_rate_hz, timeout_s, setup))
        return [tmp_path / f"p{len(taken)}.x"]

    monkeypatch.setattr(resolve, "acquire", took)
    parts = {}
    for source in ("bench", "hantek6022"):
        for most in (1, 3):
            request = acquire.CaptureRequest(source, tmp_path, 5e6, None, 7.0)
            for noted in (asked, opened, taken):
                noted.clear()
            status = resolve.resolve(2, most, request, str(tmp_path / "r.json"), Reach())
            printed = capsys.readouterr()
            result = json.loads((tmp_path / "r.json").read_text())
            lines = [
                f"status {status}", f"planned from {[of[:3] for of in asked]}, opened {opened}", f"taken {taken}",
                *printed.out.splitlines(), *(f"error: {line}" for line in printed.err.splitlines()),
                f"plan {result['plan']}", f"next {result['next_shots']}",
            ]  # fmt: skip
            parts[f"{source}, at most {most}"] = [line.replace(str(tmp_path), "FOLDER") for line in lines]
    check("resolved", parts, KEPT)
