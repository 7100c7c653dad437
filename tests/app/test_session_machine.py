"""A session after any second action: notes, effects, fits, verdicts and the order of its shots are as a simple model's.

What was saved is there after the session is opened again; what could not be saved is said.
"""

import copy
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Diagnosis, Verdict
from analysis.shot.shot import AnalysisSettings
from app.session.session import Session
from app.session.verdict_basis import diagnose_shots
from app.session.workbench import Workbench
from app.words.model_texts import verdict_words
from instrument.files.atomic_file import write_json_atomic
from tests.app import synthetic
from tests.app.stepped_work import LONGEST_S, SteppedWork

EFFECTS = effects_named(("viscous_drag", "quadratic_drag", "coulomb_friction"))
BASE = "paper"


class AtOnce(SteppedWork):
    """Work that ends as soon as it begins; a diagnosis finds now an effect, now nothing, and is numbered."""

    def __init__(self, diagnosed: list[Diagnosis]) -> None:
        super().__init__()
        self.diagnosed = diagnosed

    def run(self, work: "partial[Any]", progress: Callable[..., None], cancelled: Callable[[], bool]) -> Any:
        """Return the made-up result."""
        if work.func is not diagnose_shots:
            self._go.set()
            return super().run(work, progress, cancelled)
        found = replace(synthetic.diagnosis(self.fitted), seconds=float(len(self.diagnosed)))
        if len(self.diagnosed) % 2:
            found = replace(found, verdict=Verdict.ADEQUATE, effects=())
        self.diagnosed.append(found)
        return found


@dataclass
class Line:
    """One shot as it must be shown."""

    number: int
    name: str
    path: str | None
    copy_of: int | None = None
    note: str = ""
    verdict: str = ""


@dataclass
class Shown:
    """What a session must show, and what was undone and can be: pairs of functions that take back and do again."""

    lines: list[Line] = field(default_factory=list)
    effects: tuple[str, ...] = ()
    highest: int = 0
    done: list[tuple[Callable[[], None], Callable[[], None]]] = field(default_factory=list)
    undone: list[tuple[Callable[[], None], Callable[[], None]]] = field(default_factory=list)

    def list_shot(self, name: str, path: str | None, copy_of: int | None = None) -> None:
        """List a new shot at the end."""
        self.highest = 1 + max(self.highest, *(line.number for line in self.lines), 0)
        self.lines.append(Line(self.highest, name, path, copy_of))

    def line(self, number: int) -> Line:
        """Return the line of a shot."""
        return next(line for line in self.lines if line.number == number)

    def do(self, forth: Callable[[], None], back: Callable[[], None]) -> None:
        """Do what can be undone."""
        forth()
        self.done.append((forth, back))
        self.undone.clear()

    def note(self, number: int, note: str) -> None:
        """Set a note."""
        before = self.line(number).note

        def to(words: str) -> Callable[[], None]:
            return lambda: setattr(self.line(number), "note", words)

        self.do(to(note), to(before))

    def use(self, effects: tuple[str, ...]) -> None:
        """Set the effects in the model."""
        before = self.effects
        if effects != before:
            self.do(lambda: setattr(self, "effects", effects), lambda: setattr(self, "effects", before))

    def take_off(self, number: int) -> None:
        """Take a shot off the list."""
        gone: list[Line] = []

        def back() -> None:
            self.lines = sorted([*self.lines, gone.pop()], key=lambda line: line.number)

        def forth() -> None:
            gone.append(self.line(number))
            self.lines.remove(gone[-1])

        self.do(forth, back)

    def saved(self) -> "Shown":
        """Return what of this a file keeps: what has a recording."""
        kept = [copy.copy(line) for line in self.lines if line.path is not None]
        return Shown(kept, self.effects, max((line.number for line in kept), default=0))


class Sessions(RuleBasedStateMachine):
    """Random orders of what a person does with a session, each action at its end before the next."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.diagnosed: list[Diagnosis] = []
        self.disk_full = False
        self.kept: dict[Path, Shown] = {}  # what each file must hold
        self.written: Path | None = None  # since the last look
        self.patched = patch("app.session.session.write_json_atomic", self._write)
        self.patched.start()
        self.count = 0
        self.path = self.folder / "session-0.json"
        self.shown = Shown()
        self.newest: list[tuple[set[int], Diagnosis]] = []
        self.bench = self._bench()
        self.open_recording()
        self.shown_is_as_it_must_be()

    def teardown(self) -> None:
        self.bench.close()
        self.patched.stop()
        shutil.rmtree(self.folder)

    def _bench(self) -> Workbench:
        apart: Any = AtOnce(self.diagnosed)
        return Workbench(Session.reopen(self.path), AnalysisSettings, subprocess_worker=apart)

    def _write(self, path: Path, document: dict[str, Any], *, sync: bool = False) -> None:
        if self.disk_full:
            raise OSError(28, "No space left on device")
        write_json_atomic(path, document, sync=sync)
        self.written = path

    def _to_the_end(self) -> None:
        """Wait until all work has ended, and with it what that asked for."""
        end = time.monotonic() + LONGEST_S
        while True:
            busy = self.bench.jobs.open_jobs or self.bench.short_jobs.open_jobs  # before polling
            if not self.bench.poll() and not busy:
                break
            assert time.monotonic() < end
            time.sleep(0.0005)

    def _some(self, data: st.DataObject) -> Line:
        return data.draw(st.sampled_from(self.shown.lines))

    # what a person does -----------------------------------------------------------------------------------------

    @rule()
    def open_recording(self) -> None:
        self.count += 1
        path = self.folder / f"shot-{self.count}.csv"
        path.write_text("time_s,displacement_m\n")
        assert self.bench.open_paths([path]) == 1
        self._to_the_end()
        self.shown.list_shot(path.stem, str(path))

    @rule()
    def capture_into_memory(self) -> None:
        self.count += 1
        shot = replace(synthetic.shot(), name=f"shot-{self.count}", path=None)
        self.bench.add_shot(shot)
        self._to_the_end()
        self.shown.list_shot(shot.name, None)

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data(), note=st.sampled_from(("", "plate cleaned", "odd")))
    def note(self, data: st.DataObject, note: str) -> None:
        number = self._some(data).number
        self.bench.set_note(number, note)
        self.shown.note(number, note)

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def analyse_again(self, data: st.DataObject) -> None:
        line = self._some(data)
        assert self.bench.reanalyse([line.number]) == (line.path is not None)
        self._to_the_end()
        if line.path is not None:
            self.shown.list_shot(line.name, line.path, line.number)

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data(), every=st.booleans())
    def diagnose(self, data: st.DataObject, every: bool) -> None:
        lines = self.shown.lines if every else [self._some(data)]
        numbers = [line.number for line in lines]
        assert self.bench.diagnose(numbers) is None
        self._to_the_end()
        found = self.diagnosed[-1]
        self.newest.insert(0, (set(numbers), found))
        for line in lines:
            line.verdict = verdict_words(found.verdict, tuple(finding.effect for finding in found.effects))

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def take_off_the_list(self, data: st.DataObject) -> None:
        number = self._some(data).number
        self.bench.session.remove([number])
        self.shown.take_off(number)

    @rule(name=st.sampled_from(EFFECTS))
    def add_an_effect(self, name: str) -> None:
        self.bench.model.add(BASE, (name,))
        if name not in self.shown.effects:
            self.shown.use((*self.shown.effects, name))

    @rule(name=st.sampled_from(EFFECTS))
    def take_an_effect_out(self, name: str) -> None:
        self.bench.model.remove(BASE, name)
        self.shown.use(tuple(effect for effect in self.shown.effects if effect != name))

    @rule()
    def undo(self) -> None:
        assert (self.bench.undo() is not None) == bool(self.shown.done)
        if self.shown.done:
            self.shown.undone.append(self.shown.done.pop())
            self.shown.undone[-1][1]()

    @rule()
    def redo(self) -> None:
        assert (self.bench.redo() is not None) == bool(self.shown.undone)
        if self.shown.undone:
            self.shown.done.append(self.shown.undone.pop())
            self.shown.done[-1][0]()

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def diagnose_and_undo_what_was_before(self, data: st.DataObject) -> None:
        self.diagnose(data, every=True)
        self.undo()

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def undo_and_go_another_way(self, data: st.DataObject) -> None:
        self.undo()
        if self.shown.lines:
            self.note(data, "another way")
        self.redo()

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def take_off_the_list_and_back_and_off(self, data: st.DataObject) -> None:
        self.take_off_the_list(data)
        self.undo()
        self.redo()

    @precondition(lambda self: self.shown.lines)
    @rule(data=st.data())
    def note_while_the_disk_is_full_and_after(self, data: st.DataObject) -> None:
        self.disk_full = True
        self.note(data, "kept in memory")
        self.what_is_not_saved_is_said()
        self.disk_full = False
        self.note(data, "on disk")

    @rule(full=st.booleans())
    def disk_fills_or_is_freed(self, full: bool) -> None:
        self.disk_full = full

    @rule()
    def save_as(self) -> None:
        self.count += 1
        if not self.disk_full and self.path in self.kept:
            self.kept[self.path] = self.shown.saved()
        self.path = self.folder / f"session-{self.count}.json"
        assert (self.bench.save_session(self.path) is not None) == self.disk_full

    @rule(busy=st.booleans())
    def start_anew(self, busy: bool) -> None:
        """``busy``: a person writes a note before any recording is read, and starts once more."""
        self.bench.close()
        if self.written == self.path:  # what a full disk had refused
            self.kept[self.path] = self.shown.saved()
        self.written = None
        self.bench = self._bench()
        kept = self.kept.get(self.path)
        if busy and kept is not None and kept.lines:
            self.bench.set_note(kept.lines[0].number, "early")
            if not self.disk_full:
                kept.lines[0].note = "early"
            self.written = None
            self.bench.close()
            self.bench = self._bench()
        self.bench.read_unread()
        self._reopened()

    @rule(data=st.data())
    def open_another(self, data: st.DataObject) -> None:
        path = data.draw(st.sampled_from(sorted(self.kept)))
        if path == self.path:
            return
        if not self.disk_full:
            self.kept[self.path] = self.shown.saved()
        self.path = path
        assert self.bench.open_session(path) is None
        self.written = None
        self._reopened()
        self.undo()  # nothing of the session before

    def _reopened(self) -> None:
        kept = self.kept.get(self.path)
        self.shown = kept.saved() if kept is not None else Shown()
        self.newest.clear()

    # what must be shown -----------------------------------------------------------------------------------------

    @invariant()
    def shown_is_as_it_must_be(self) -> None:
        self._to_the_end()
        session = self.bench.session
        there = [Line(e.number, e.name, e.path, e.copy_of, e.note, e.verdict) for e in session.entries]
        assert there == self.shown.lines
        assert session.effects.of(BASE) == self.shown.effects
        for entry in session.entries:
            assert entry.shot is not None and entry.shot.fit is not None, f"{entry.name} was not read"
            assert entry.shot.fit.effects == entry.shot.settings.effects == self.shown.effects
            assert (entry.shot.name, entry.shot.path) == (entry.name, entry.path)

    @invariant()
    def the_newest_diagnosis_is_shown(self) -> None:
        newest = self.bench.diagnoses.newest
        assert (newest and newest.diagnosis) is (self.newest[0][1] if self.newest else None)
        for line in self.shown.lines:
            about = [found for numbers, found in self.newest if numbers == {line.number}]
            about += [found for numbers, found in self.newest if line.number in numbers]
            told = self.bench.diagnoses.of([line.number])
            assert (told and told.diagnosis) is (about[0] if about else None)

    @invariant()
    def what_is_not_saved_is_said(self) -> None:
        if self.written == self.path:
            self.kept[self.path] = self.shown.saved()
            assert self.bench.session.problem is None or self.disk_full
        self.written = None
        kept = self.kept.get(self.path, Shown())
        now = self.shown.saved()
        if (kept.lines, kept.effects) != (now.lines, now.effects):
            assert "could not be saved" in (self.bench.session.problem or "")


Sessions.TestCase.settings = settings(
    max_examples=50, stateful_step_count=20, deadline=None, suppress_health_check=list(HealthCheck)
)
TestSessions = Sessions.TestCase


@pytest.mark.parametrize("then", ["start_anew", "save_as"])
def test_what_a_full_disk_refused_is_saved_before_the_session_is_left(then: str) -> None:
    session = Sessions()
    try:
        first = session.path
        session.what_is_not_saved_is_said()
        for full in (True, False):
            session.disk_fills_or_is_freed(full)
            if full:
                session.open_recording()
            session.what_is_not_saved_is_said()
        assert len(Session.reopen(first).entries) == 1
        session.start_anew(False) if then == "start_anew" else session.save_as()
        session.shown_is_as_it_must_be()
        session.what_is_not_saved_is_said()
        assert len(Session.reopen(first).entries) == 2
    finally:
        session.teardown()


def test_a_number_is_not_given_twice_after_opening_again(tmp_path: Path) -> None:
    first = Session(tmp_path / "session.json")
    for name in ("a", "b"):
        first.add(replace(synthetic.bare_shot(name), path=f"/data/{name}.sigmf-meta"))
    first.set_note(2, "the note of b")
    again = Session.reopen(tmp_path / "session.json")
    again.remove([2])
    again.add(replace(synthetic.bare_shot("c"), path="/data/c.sigmf-meta"))
    again.undo()
    assert {entry.name: entry.note for entry in again.entries} == {"a": "", "b": "the note of b", "c": ""}


def test_undo_and_redo_of_a_note_reach_the_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    in_recording: dict[Path, str] = {}
    monkeypatch.setattr("app.session.workbench.rewrite_note", in_recording.__setitem__)
    bench = Workbench(Session(), AnalysisSettings)
    path = Path("/data/shot.sigmf-meta")

    def written() -> str:
        while bench.short_jobs.open_jobs or bench.poll():
            time.sleep(0.0005)
        return in_recording[path]

    try:
        bench.session.add(replace(synthetic.bare_shot("shot"), path=str(path)))
        bench.set_note(1, "first")
        bench.set_note(1, "second")
        assert written() == "second"
        bench.undo()
        assert bench.session.entries[0].note == written() == "first"
        bench.redo()
        assert bench.session.entries[0].note == written() == "second"
    finally:
        bench.close()
