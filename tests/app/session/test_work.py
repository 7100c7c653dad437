"""What a session does with its shots: the events that the screen is told, the jobs, the files; slow work is given."""

import json
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import app.report
from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.model_file import from_text
from analysis.diagnosis.findings.result import Errors, PredictedShot, PredictionTest
from analysis.drive.catalogue import LAWS
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisSettings
from app.session import load, model_in_use, model_work, workbench
from app.session.model_in_use import OwnLaws, drift_words, load_model
from app.session.session import Session
from app.session.verdict_basis import Diagnosed, Diagnoses, ModelEffects
from app.session.workbench import Workbench
from instrument.capture.snapshot import CapturedShot
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_error import RecordingError, SomeShotsNotSaved
from tests.app import synthetic
from tests.app.window.scene import check

KEPT = Path(__file__).parent / "written"
DRAG, TILT = effects_named(("quadratic_drag", "tilt"))
LONGEST_S = 180.0


def _captured(number: int, name: str, path: Path | None) -> CapturedShot:
    return CapturedShot(number, name, path, CaptureSettings(1e6, 64, 0))


class Bench:
    """A workbench whose events and jobs are written down."""

    def __init__(self, folder: Path, shots, **given):
        self.folder = folder
        self.settings = AnalysisSettings()
        self.workbench = Workbench(
            Session(folder / "session.json"), lambda: self.settings, own_laws=OwnLaws(folder / "laws"), **given
        )
        for shot in shots:
            self.workbench.session.add(shot)
        self.jobs: list[str] = []
        for jobs in (self.workbench.jobs, self.workbench.short_jobs):
            jobs.submit = self._watched(jobs.submit)

    def _watched(self, submit):
        def submitted(name, work, kind="", *rest, **named):
            self.jobs.append(f"job {kind}: {name}")
            return submit(name, work, kind, *rest, **named)

        return submitted

    def said(self) -> list[str]:
        """Wait for all work; return jobs and events since the last call."""
        found, end = [], time.monotonic() + LONGEST_S
        while True:
            busy = self.workbench.jobs.open_jobs + self.workbench.short_jobs.open_jobs
            events = self.workbench.poll()
            found += [f"{e.kind.value} {list(e.numbers)}: {e.words[:300]}{self._paths(e)}" for e in events]
            if not busy and not events and not self.workbench.jobs.open_jobs + self.workbench.short_jobs.open_jobs:
                break
            assert time.monotonic() < end
            time.sleep(0.002)
        jobs, self.jobs[:] = list(self.jobs), []
        return [line.replace(str(self.folder), "FOLDER") for line in (*jobs, *found)]

    def _paths(self, event) -> str:
        return f" {[path.name for path in event.paths]}" if event.paths else ""

    @property
    def listed(self) -> list[str]:
        """Get a line for each entry."""
        return [
            f"{e.number} {e.name}: {Path(e.path).name if e.path else '-'}, verdict {e.verdict!r}, note {e.note!r}, "
            f"copy of {e.copy_of}, "
            f"{'not read' if e.shot is None else e.shot.problem or [effect.name for effect in e.shot.settings.effects]}"
            for e in self.workbench.session.entries
        ]


@pytest.fixture
def bench(tmp_path):
    made = []

    def opened(*shots, **given):
        made.append(Bench(tmp_path, shots, **given))
        return made[-1]

    yield opened
    for one in made:
        one.workbench.close()


def _two():
    return synthetic.shot("run-1", 0.265, 1), synthetic.shot("run-2", 0.2, 2)


def test_exports_of_the_entries_named_or_of_all(bench, tmp_path, monkeypatch):
    first, second = _two()
    one = bench(first, second)
    work, parts = one.workbench.exports, {}
    one.workbench.session.set_note(2, "by hand")
    found = synthetic.diagnosis(first)
    one.workbench._take_diagnosis((1,), replace(found, laws=(synthetic.learned_law(),)))
    parts["diagnosed"] = one.said()
    for name, numbers in (("all", []), ("one", [1]), ("the other", [2]), ("not there", [9])):
        folder = tmp_path / name
        work.export(numbers, folder)
        parts[f"export of {name}"] = [*one.said(), *sorted(path.name for path in folder.iterdir())]
    rows = (tmp_path / "the other" / "shots.csv").read_text().splitlines()
    assert "by hand" in rows[1] and len(rows) == 2
    work.export_hdf5([1], tmp_path / "h5")
    work.export_hdf5([2], tmp_path / "h5")  # the folder is there already
    parts["HDF5"] = [*one.said(), *sorted(path.name for path in (tmp_path / "h5").iterdir())]
    one.workbench.session.set_effects(ModelEffects(collision=(TILT,), tried=(TILT,)))
    monkeypatch.setattr(app.report, "write_pdf", lambda text, path: path.write_text(f"as PDF: {text}"))
    work.report([1, 2], tmp_path / "report.html")
    work.report([1], tmp_path / "report.PDF")
    work.report_to_print([2])
    parts["reports"] = [line.partition("<html")[0] for line in one.said()]
    html = (tmp_path / "report.html").read_text()
    assert "by hand" in html and "Verdict" in html  # the diagnosis of shot 1 is within both
    assert (tmp_path / "report.PDF").read_text().startswith("as PDF: <!DOCTYPE html>")
    (tmp_path / "taken").write_text("")
    work.export([1], tmp_path / "taken")
    parts["a folder that is a file"] = one.said()
    check("exports", parts, KEPT)


def test_models_are_saved_loaded_and_tested(bench, tmp_path, monkeypatch):
    first, second = _two()
    one = bench(first, second)
    work, parts, path = one.workbench, {}, tmp_path / "model.toml"
    fits = []

    def jointly(shots, base, effects, cancelled):
        fits.append((len(shots), base, [effect.name for effect in effects]))
        return first.fit

    monkeypatch.setattr(model_in_use, "fit_jointly", jointly)
    work.exports.save_model([1, 2], path)
    parts["the fit of the shots alone"] = [*one.said(), *path.read_text().replace(str(tmp_path), "FOLDER").splitlines()]
    assert fits == [(2, "paper", [])]
    drag = {f"{DRAG.key}.coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    after = replace(first.fit, effects=(DRAG,), parameters=first.fit.parameters | drag, covariance=np.eye(5))
    work._take_diagnosis((1, 2), replace(synthetic.diagnosis(first), fit_after=after))
    monkeypatch.setattr(model_work, "refit_shot", _refitted)
    work.model.add("paper", (DRAG,))
    work.model.add("paper", (DRAG,))
    work.model.add_tried("paper", TILT)
    work.model.add_tried("paper", TILT)
    parts["an effect of a diagnosis, and one that is tried"] = [*one.said(), *one.listed]
    assert work.session.effects == ModelEffects((DRAG, TILT), (), (TILT,))
    work.exports.save_model([1], path)  # another set than that of the diagnosis: fitted here
    parts["saved of one shot"] = one.said()
    assert fits[-1] == (1, "paper", ["quadratic_drag", "tilt"])
    work.model.remove("paper", TILT)
    one.said()
    work.exports.save_model([1, 2], path)  # that of the diagnosis
    parts["the fit of the diagnosis"] = one.said()
    model = load_model(path)
    assert model.effects == (DRAG,) and model.tried == () and fits[-1][0] == 1
    assert from_text(path.read_text()).shots == ("run-1", "run-2")
    work.model.remove("paper", DRAG)
    parts["removed"] = [*one.said(), *one.listed]
    assert work.model.loaded_model is None
    work.model.load(path)
    parts["loaded"] = [*one.said(), *one.listed]
    assert work.model.loaded_model is not None and work.model.loaded_model.effects == (DRAG,)
    work.model.remove("paper", DRAG)
    assert work.model.loaded_model is None  # the session's model differs from the file
    one.said()
    errors = Errors(62e-9, 40e-6, 3.1e-3, 3800.0), Errors(1.1e-9, 8e-6, 2e-3, 1.01)
    shots = (PredictedShot("run-1", True, *errors), PredictedShot("run-2", False, *errors))
    monkeypatch.setattr(model_in_use, "predicted", lambda *_: PredictionTest("paper", (DRAG,), *errors, shots))
    work.exports.test_model([], path)
    parts["tested"] = one.said()
    work.exports.test_model([], tmp_path / "session.json")
    work.model.load(tmp_path / "missing.toml")
    parts["no model"] = [line.partition("(")[0] for line in one.said()]
    check("models", parts, KEPT)


def test_a_model_file_still_being_read_is_not_used_in_the_next_session(bench, tmp_path):
    one = bench(*_two())
    work, path = one.workbench, tmp_path / "model.toml"
    work.exports.save_model([1, 2], path)
    one.said()
    work.model.load(path)
    work._switch_to(Session(tmp_path / "next.json"))
    assert not any("Model" in line for line in one.said()) and work.model.loaded_model is None


def _refitted(shot, effects, *, progress, cancelled):
    return replace(shot, settings=replace(shot.settings, effects=effects), fit=replace(shot.fit, effects=effects))


def test_a_model_that_cannot_be_saved_is_said(bench, tmp_path):
    first, _ = _two()
    drive = synthetic.driven_shot()
    one = bench(first, drive, synthetic.shot("run-3", 0.3, 3, problem="no impact was found"))
    for numbers in ([1, 2], [3]):
        one.workbench.exports.save_model(numbers, tmp_path / "model.toml")
    one.workbench.session.fill(1, replace(first, fit=replace(first.fit, converged=False)))
    unfinished = replace(first.fit, converged=False)
    one.workbench._take_diagnosis((1,), replace(synthetic.diagnosis(first), fit_after=unfinished))
    one.workbench.exports.save_model([1], tmp_path / "model.toml")
    check("models-refused", {"refused": one.said()}, KEPT)
    assert not (tmp_path / "model.toml").exists()


def test_drift_is_the_parameters_far_from_the_files_in_joint_standard_uncertainties(tmp_path, bench):
    first, _ = _two()
    saved = model_in_use.write_model(tmp_path / "m.toml", first.fit, [first], None, ())
    assert drift_words(saved, first.fit) == ""

    def moved(by, of="plate_stiffness_n_per_m"):
        q = first.fit.parameters[of]
        return first.fit.parameters | {of: replace(q, value=q.value + by * np.hypot(q.std, q.std))}

    assert drift_words(saved, replace(first.fit, parameters=moved(3.9))) == ""
    assert drift_words(saved, replace(first.fit, parameters=moved(-4.2))) == "plate stiffness -4.2 σ"
    both = moved(4.5) | {"plate_mass_kg": moved(-6.0, "plate_mass_kg")["plate_mass_kg"]}
    assert drift_words(saved, replace(first.fit, parameters=both)) == "plate mass -6.0 σ, plate stiffness +4.5 σ"
    assert drift_words(saved, replace(first.fit, parameters=both, model="clamped")) == ""
    assert drift_words(saved, replace(first.fit, parameters=both, converged=False)) == ""


def test_diagnoses_are_named_by_their_shots_and_refused_with_a_reason(bench, monkeypatch, tmp_path):
    shots = [synthetic.shot(f"run-{n}", 0.2 + 0.01 * n, n) for n in range(1, 9)]
    drive, failed = synthetic.driven_shot(), synthetic.shot("failed", 0.3, 3, problem="no impact was found")
    one = bench(*shots, drive, failed)
    asked = []

    def diagnosed(chosen, accepted, laws, seconds, *, progress, cancelled):
        asked.append(([s.name for s in chosen], [e.name for e in accepted], len(laws), seconds))
        return replace(synthetic.diagnosis(chosen[0]), not_asked=("laws", "pairs") if len(chosen) > 2 else ())

    monkeypatch.setattr(workbench, "diagnose_shots", diagnosed)
    parts = {"refused": [str(one.workbench.diagnose(numbers)) for numbers in ([], [10], [1, 9], [99])]}
    assert asked == []
    for numbers in ([1], [1, 2, 10], list(range(1, 9))):
        assert one.workbench.diagnose(numbers) is None
        parts[f"of {numbers}"] = one.said()
    one.settings = replace(one.settings, diagnosis_seconds=7.0)
    one.workbench.own_laws.keep(synthetic.learned_law().effect.written())
    (tmp_path / "laws" / "spoilt.toml").write_text("name = 3")
    one.workbench.session.set_effects(ModelEffects(collision=(TILT,), drive=(DRAG,)))
    one.workbench.diagnose([2])
    one.workbench.diagnose([9])
    parts["with a law, another one spoilt"] = [line.partition("(")[0] for line in one.said()]
    parts["asked for"] = list(map(str, asked))
    parts["the list"] = one.listed
    check("diagnoses", parts, KEPT)
    numbers = [found.numbers for found in one.workbench.diagnoses]
    assert numbers == [(1,), (1, 2), tuple(range(1, 9)), (2,), (9,)]


def test_which_diagnosis_is_shown_and_reported():
    shots = [Diagnosed(n, numbers) for n, numbers in enumerate(((1,), (1, 2), (2, 3), (1, 2)))]
    found = Diagnoses(shots)
    assert found.newest is shots[3] and Diagnoses().newest is None
    assert found.of([2, 1]) is shots[3] and found.of([1]) is shots[0]
    assert found.of([1, 3]) is shots[2]  # none of just these: the newest with the last
    assert found.of([4]) is None and found.of([3, 2]) is shots[2]
    assert found.within({1, 2, 3}) is shots[3] and found.within({2, 3}) is shots[2] and found.within({3}) is None


def test_recordings_are_opened_analysed_again_and_filled_in(bench, monkeypatch, tmp_path):
    first, _ = _two()
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("time_s,displacement_m\n0,0\n")
        (tmp_path / f"{name}.toml").write_text("")
    asked = []

    def loaded(path, *, settings, effects_of, progress, cancelled):
        asked.append((path.name, settings.bandwidth_hz, settings.corrections, [e.name for e in effects_of("paper")]))
        shot = replace(first, name=path.stem, path=str(path), settings=settings)
        return replace(shot, motion=None, problem="spoilt") if path.stem == "b" and len(asked) < 4 else shot

    monkeypatch.setattr(workbench, "load_and_analyse", loaded)
    one = bench(again=lambda: AnalysisSettings(bandwidth_hz=5e3, corrections=(("moving_mass_kg", 0.02),)))
    monkeypatch.setattr(workbench, "find_recordings", lambda paths: [tmp_path / "a.csv", tmp_path / "b.csv"])
    assert one.workbench.open_paths([tmp_path]) == 2
    parts = {"opened": [*one.said(), *one.listed]}
    assert one.workbench.corrections_in_words() == "moving mass 20 g"
    assert one.workbench.reanalyse([1, 2, 7]) == 2
    parts["analysed again: a copy of one, the other itself"] = [*one.said(), *one.listed]
    parts["asked for"] = list(map(str, asked))
    entry = one.workbench.add_captured(_captured(1, "shot-9", tmp_path / "shot-9.sigmf-meta"))
    taken = replace(first, name="shot-9", path=str(tmp_path / "shot-9.sigmf-meta"))
    assert one.workbench.add_shot(taken, 1).number == entry.number
    assert one.workbench.add_shot(taken, 2).number == entry.number + 1  # another capture of that name
    gone = one.workbench.add_captured(_captured(3, "shot-10", None))
    one.workbench.session.remove([gone.number])
    assert one.workbench.add_shot(replace(first, name="shot-10", path=None), 3) is None
    late = one.workbench.add_unanalysed(
        replace(_captured(4, "", tmp_path / "c.sigmf-meta"), problem="the analysis was stopped")
    )
    assert late.shot.problem == "the analysis was stopped: analyse it again (Ctrl+R)" and late.name == "c"
    parts["captured"] = [*one.said(), *one.listed]
    check("opened", parts, KEPT)


def test_shots_in_memory_are_saved_elsewhere(bench, tmp_path):
    first, second = (replace(shot, path=None) for shot in _two())
    one = bench(first)
    one.workbench.unsaved.save(lambda folder: {"run-1": folder / "run-1.sigmf-meta", "run-2": folder / "2"}, tmp_path)
    parts = {"both": one.said()}
    assert one.workbench.session.entry(1).path == str(tmp_path / "run-1.sigmf-meta")
    assert one.workbench.add_shot(second).path == str(tmp_path / "2")  # saved before its analysis ended
    assert one.workbench.unsaved.path_of("run-2") is None

    def full(folder):
        raise SomeShotsNotSaved(RecordingError(tmp_path, "the disk is full"), {"run-3": tmp_path / "3"})

    one.workbench.unsaved.save(lambda _: {}, tmp_path)
    parts["none"] = one.said()
    one.workbench.unsaved.save(full, tmp_path)
    parts["one of several"] = one.said()
    check("unsaved", parts, KEPT)


def test_recordings_that_no_session_lists_are_said(bench, tmp_path, monkeypatch):
    one = bench()
    names = [tmp_path / f"shot-{n}.sigmf-meta" for n in range(5)]
    parts = {}
    for name, complete, cut_off in (("one", 1, 0), ("two and one cut off", 2, 1), ("five", 5, 0)):
        one.workbench._take_unlisted(workbench.Unlisted(tuple(names[:complete]), tuple(names[:cut_off])))
        parts[name] = one.said()
    check("unlisted", parts, KEPT)


def test_a_problem_of_reading_is_one_line(tmp_path):
    path = tmp_path / "a.csv"
    causes = (
        RecordingError(path, "spoilt"), PermissionError(13, "Permission denied", "/x"), OSError("gone"), MemoryError(),
        ValueError("two\nlines"),
    )  # fmt: skip
    said = [load.cause_of(path, cause).replace(str(tmp_path), "FOLDER") for cause in causes]
    assert said == [
        "FOLDER/a.csv: spoilt".replace("/", os.sep), "/x: Permission denied", f"FOLDER{os.sep}a.csv: gone",
        f"FOLDER{os.sep}a.csv: not enough memory", "a fault of the program: ValueError: two lines",
    ]  # fmt: skip
    for name, stem in (("a.sigmf-meta", "a"), ("b.sigmf-data", "b"), ("c.csv", "c.csv")):
        assert load.unanalysed(tmp_path / name, AnalysisSettings(), "why").name == stem
    shot = load.unanalysed(None, AnalysisSettings(model="clamped"), "why", "shot-3")
    assert (shot.name, shot.path, shot.problem, shot.settings.model) == ("shot-3", None, "why", "clamped")


def test_the_file_of_a_session_holds_all_that_is_the_operators(bench, tmp_path):
    first, second = _two()
    one = bench(replace(first, path="/data/a.csv"), replace(second, path="/data/b.csv"), second)
    session = one.workbench.session
    session.set_note(2, "by hand")
    one.workbench._take_diagnosis((1, 2), synthetic.diagnosis(first))
    law = next(iter(LAWS.values()))
    session.set_effects(ModelEffects((DRAG,), (law,), (law,)))
    session.dismiss(["/data/c.csv", "/data/d.csv", "/data/c.csv"])
    one.said()
    written = json.dumps(json.loads((tmp_path / "session.json").read_text()), indent=1, sort_keys=True)
    check("file", {"session.json": written.splitlines()}, KEPT)
    again = Session.reopen(tmp_path / "session.json")
    assert again.effects == session.effects and again.dismissed == ("/data/c.csv", "/data/d.csv")
