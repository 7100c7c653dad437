"""What the window does with shots away from the rig: open, re-analyse, export, diagnose, change the model.

Plain Python: every piece of work is a job, done in a process of its own where there is one, and comes back as a
Event that the screen polls.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from analysis.diagnosis import diagnose
from analysis.diagnosis.model_file import SavedModel
from analysis.diagnosis.result import Diagnosis
from analysis.shot import AnalysisSettings, Shot
from app.session.cut_off import cut_off
from app.session.event import Diagnosed, Event, Filled, InSession, Kind, Loaded, Opened, Reopened, SavedElsewhere
from app.session.jobs import Asked, Job, Jobs, Report
from app.session.load import unanalysed
from app.session.model_in_use import load_model, model_words
from app.session.own_laws import OwnLaws
from app.session.own_session import held, named_session, own_session
from app.session.put_to_test import put_to_test
from app.session.results import Key, Results
from app.session.saver import Saver
from app.session.session import Entry, Session
from app.session.settings import correction_words
from app.session.shot_work import open_shot, refit_shot, report_text, write_csv, write_model, write_report
from app.words.verdict import verdict_words
from instrument.apart.work import WorkApart
from instrument.recording_error import PartlySaved, RecordingError
from instrument.recording_file import find_recordings, rewrite_note

AT_ONCE = 10  # kept results are read and shown


class Workbench:
    """Session, jobs and the effects now in the model."""

    def __init__(
        self,
        session: Session,
        settings: Callable[[], AnalysisSettings],
        saver: Saver | None = None,
        apart: WorkApart | None = None,
        again: Callable[[], AnalysisSettings] | None = None,
        results: Results | None = None,
        own_laws: OwnLaws | None = None,
    ) -> None:
        """``saver``: the session is saved by it, in its thread; ``apart`` does the long work, else the jobs' thread.

        ``again``: the settings of an analysis repeated, with what was put right meanwhile; else ``settings``.
        ``results``: where shots and diagnoses are kept for the next start.
        ``own_laws``: the folder of laws that a diagnosis asks beside the catalogue.
        """
        self.session = session
        self._saver = saver
        self._apart = apart
        if saver is not None:
            session.save_by = saver.submit
        self.own_laws = own_laws or OwnLaws(None)
        self.jobs = Jobs()
        self.errands = Jobs()  # short work that must not wait behind a diagnosis
        self._paths_ahead: dict[str, str] = {}  # of shots saved elsewhere before they were analysed, by name
        self.known: SavedModel | None = None  # the model file in use
        self._results = results
        self._turn = 0  # how many sessions were before this one: what was asked in those is not of this
        self._usual = session.path.parent if session.path is not None else None
        self.diagnoses: list[Diagnosed] = []  # the newest last
        self._settings, self._again = settings, again or settings
        self._waiting: list[Event] = []

    def effects_of(self, base: str) -> tuple[str, ...]:
        """Return the effects now in the model of shots with this base."""
        return self.session.effects.of(base)

    @property
    def diagnosed(self) -> Diagnosed | None:
        """Get the newest diagnosis."""
        return self.diagnoses[-1] if self.diagnoses else None

    def diagnosis_of(self, numbers: Sequence[int]) -> Diagnosed | None:
        """Return the newest diagnosis of just these entries, else of some with the last of them, or None."""
        newest = self.diagnoses[::-1]
        exact = next((found for found in newest if set(found.numbers) == set(numbers)), None)
        return exact or next((found for found in newest if set(numbers[-1:]) & set(found.numbers)), None)

    def close(self) -> bool:
        """Cancel all work and wait for it; return whether the threads ended."""
        ended = self.jobs.close() & self.errands.close()
        if self._apart is not None:
            self._apart.close()
        ended &= self._saver is None or self._saver.close()
        self.session.give_free()
        return ended

    # sessions ---------------------------------------------------------------------------------------------------

    def open_session(self, path: Path) -> str | None:
        """Go on with the session kept in a file; return why not, or None."""
        if self.session.path is not None and path.absolute() == self.session.path.absolute():
            return None
        try:
            other = named_session(path)
        except RecordingError as error:
            return str(error)
        self._go_on(other)
        return other.problem

    def usual_session(self) -> str | None:
        """Go on with the session that has no name; return why not, or None."""
        if self._usual is None:
            return "this window keeps no session"
        self._go_on(own_session(self._usual))
        return self.session.problem

    def save_session(self, path: Path) -> str | None:
        """Keep the session in another file from now on; return why not, or None."""
        if path.absolute() == (self.session.path or Path()).absolute():
            return None
        try:
            self.session.move_to(path, held(path))
        except RecordingError as error:
            return str(error)
        return self.session.problem

    def _go_on(self, other: Session) -> None:
        for kind in ("open", "refit", "diagnosis", "plan", "kept"):
            self.jobs.cancel(kind)
            self.errands.cancel(kind)
        self._turn += 1
        self.diagnoses = []
        self.session.become(other)
        self.read_unread()

    # what is asked for ------------------------------------------------------------------------------------------

    def open_paths(self, paths: Sequence[Path]) -> int:
        """Queue every recording under these files and folders; return how many."""
        found = find_recordings(paths)
        for path in found:
            self._submit_open(path, self._settings())
        return len(found)

    def read_unread(self) -> None:
        """Queue the recordings of entries that a reopened session lists."""
        unread = [entry for entry in self.session.entries if entry.shot is None and entry.path is not None]
        results = self._results
        if results is None:
            for entry in unread:
                self._submit_fill(entry)
            return
        keys = {entry.number: self._key(entry) for entry in unread}
        for start in range(0, len(unread), AT_ONCE):  # the last first: the session opens there
            some = unread[::-1][start : start + AT_ONCE]
            self._submit(
                self.errands, "kept results", partial(_reopened, results, [e.number for e in some], keys), "kept"
            )
        self._submit(self.errands, "kept diagnoses", partial(_diagnoses, results, keys), "kept")

    def _key(self, entry: Entry) -> Key:
        """Return what an entry's result is kept under."""
        effects = self.effects_of(entry.settings.model)
        return Key(entry.path or "", replace(entry.settings, effects=effects))

    def _keep(self, shots: Sequence[Shot]) -> None:
        results = self._results
        if results is not None:

            def work(_: Report, __: Asked) -> None:
                for shot in shots:
                    results.keep_shot(shot)

            self.errands.submit("keeping results", work, "keep")

    def _keep_diagnosis(self, found: Diagnosed) -> None:
        results = self._results
        entries = [self.session.entry(number) for number in found.numbers]
        keys = [self._key(entry) for entry in entries if entry is not None and entry.path is not None]
        if results is not None and len(keys) == len(found.numbers):
            self.errands.submit(
                "keeping a diagnosis", lambda _, __: results.keep_diagnosis(found.diagnosis, keys), "keep"
            )

    def look_for_cut_off(self, folder: Path) -> None:
        """Queue a look for recordings in ``folder`` that a kill cut off and the session does not list."""
        listed = {entry.path for entry in self.session.entries if entry.path is not None}
        now_s = time.time()

        def work(_: Report, __: Asked) -> Event | None:
            found = tuple(cut_off(folder, listed, now_s))
            if not found:
                return None
            names = ", ".join(path.name.removesuffix(".sigmf-meta") for path in found[:3])
            more = f" and {len(found) - 3} more" if len(found) > 3 else ""
            words = f"The program ended while it recorded {names}{more}: as far as it got it is saved, not listed"
            return Event(Kind.CUT_OFF, words, paths=found)

        self.errands.submit("cut-off recordings", work, "look")

    def reanalyse(self, numbers: Sequence[int]) -> int:
        """Queue copies of these entries with the present settings; return how many.

        An entry that was never analysed is filled in its own place.
        """
        count = 0
        for entry in self._entries(numbers):
            if entry.path is None:
                continue
            if entry.shot is not None and entry.shot.motion is None:
                self._submit_fill(replace(entry, settings=self._again()))
            else:
                self._submit_open(Path(entry.path), self._again(), copy_of=entry.number)
            count += 1
        return count

    def put_right(self) -> str:
        """Return in words which values of the rig an analysis repeated now puts right; "" where none is."""
        return ", ".join(correction_words(self._again().corrections))

    def add_shot(self, shot: Shot) -> Entry:
        """Take a shot that the rig captured and analysed; the model may have changed meanwhile."""
        path = self._paths_ahead.pop(shot.name, None) if shot.path is None else None
        entry = self.session.add(shot if path is None else replace(shot, path=path))
        if shot.settings.effects != self.effects_of(shot.settings.model):
            self._submit_refit([entry])
        elif entry.shot is not None:
            self._keep([entry.shot])
        return entry

    def add_unanalysed(self, path: Path | None, problem: str, name: str) -> Entry:
        """List a shot that the rig captured and nobody analysed: ``reanalyse`` does."""
        ahead = self._paths_ahead.pop(name, None) if path is None else None
        words = f"{problem}: analyse it again (Ctrl+R)"
        return self.session.add(unanalysed(Path(ahead) if ahead else path, self._settings(), words, name))

    def export(self, numbers: Sequence[int], folder: Path) -> None:
        """Queue the export of these entries, or of all when none is named."""
        shots, diagnosis = self._reported(numbers)
        self._submit_export("export", partial(write_csv, shots, diagnosis, folder))

    def save_elsewhere(self, save: Callable[[Path], dict[str, Path]], folder: Path) -> None:
        """Queue the saving of shots that are only in memory; ``save`` does it and returns each one's path by name."""

        def work(_: Report, __: Asked) -> SavedElsewhere:
            try:
                return SavedElsewhere(save(folder), folder)
            except PartlySaved as error:
                return SavedElsewhere(error.saved, folder, str(error))

        self.errands.submit("saving elsewhere", work, "save")

    def diagnose(self, numbers: Sequence[int]) -> str | None:
        """Queue the diagnosis of these entries; return why not, or None."""
        chosen = [entry for entry in self._entries(numbers) if entry.shot is not None and entry.shot.motion is not None]
        if not chosen:
            return "select at least one analysed shot"
        models = {entry.settings.model for entry in chosen}
        if len(models) > 1:
            return f"the selected shots use different base models ({', '.join(sorted(models))}): select shots of one"
        motions = [e.shot.motion for e in chosen if e.shot is not None and e.shot.motion is not None]
        ids = tuple(entry.number for entry in chosen)
        (model,) = models
        laws, problems = self.own_laws.keys()
        self._waiting += [Event(Kind.PROBLEM, problem) for problem in problems]
        judging = partial(diagnose, motions, model=model, accepted=self.effects_of(model), laws=laws)

        def work(report: Report, cancelled: Asked) -> Diagnosed:
            return Diagnosed(self._do(judging, report, cancelled), ids)

        self._submit(self.jobs, "diagnosis", work, "diagnosis")
        return None

    def set_note(self, number: int, note: str) -> None:
        """Keep the operator's note in the session, and in the recording itself by a job."""
        self.session.set_note(number, note)
        entry = self.session.entry(number)
        if entry is None or entry.path is None or not entry.path.endswith(".sigmf-meta"):
            return
        path = Path(entry.path)

        def work(_: Report, __: Asked) -> None:
            rewrite_note(path, note)  # RecordingError, which the job's problem says, where it is read-only

        self.jobs.submit(f"note of {entry.name}", work, "note")

    def add_effects(self, base: str, names: Sequence[str]) -> None:
        """Add effects to the model of shots with this base, each of which is fitted again."""
        now = self.effects_of(base)
        self._use(base, (*now, *(name for name in names if name not in now)))

    def try_effect(self, base: str, name: str) -> None:
        """Add an effect that no diagnosis named; it stays marked so."""
        if name not in self.effects_of(base):
            self._use(base, (*self.effects_of(base), name), tried=(name,))

    def remove_effect(self, base: str, name: str) -> None:
        """Take an effect out again."""
        self._use(base, tuple(effect for effect in self.effects_of(base) if effect != name))

    def _use(self, base: str, effects: tuple[str, ...], tried: Sequence[str] = ()) -> None:
        """Fit every shot for itself with the model: so do ``--model FILE`` and a session that is opened again.

        The joint fit of a diagnosis is its evidence, and what a model file keeps; it is no shot's own.
        """
        self.session.set_effects(self.session.effects.with_effects(base, effects).trying(tried))
        self._submit_refit([entry for entry in self.session.entries if entry.shot is not None])

    def undo(self) -> str | None:
        """Take back the last note, removal or change of the model; return what it was, or None."""
        before = self.session.effects
        what = self.session.undo()
        if self.session.effects != before:
            self._submit_refit([entry for entry in self.session.entries if entry.shot is not None])
        return what

    def save_model(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the writing of the model as these entries show it, or as all do when none is named."""
        entries = [e for e in (self._entries(numbers) or self.session.entries) if e.shot is not None]
        shots = [entry.shot for entry in entries if entry.shot is not None]
        chosen, effects = {e.number for e in entries}, self.session.effects
        found = self.diagnosis_of(sorted(chosen))
        same = found is not None and chosen == set(found.numbers)
        diagnosis = found.diagnosis if found is not None and same else None

        self._submit_export("model file", partial(write_model, path, shots, effects, diagnosis))

    def load_model(self, path: Path) -> None:
        """Queue the reading of a model file; its effects then are the model's, and every shot is fitted again."""
        self.errands.submit("model file", lambda _, __: Loaded(load_model(path), path), "model")

    def foretell(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the test of a model file, unchanged, on these entries, or on all when none is named."""
        entries = self._entries(numbers) or list(self.session.entries)
        shots = [entry.shot for entry in entries if entry.shot is not None]
        self._submit_export("model put to the test", partial(put_to_test, path, shots))

    def report(self, numbers: Sequence[int], path: Path) -> None:
        """Queue the report of these entries, or of all when none is named, as one HTML or PDF file."""
        self._submit_export("report", partial(write_report, path, *self._reported(numbers), self._tried))

    def report_to_print(self, numbers: Sequence[int]) -> None:
        """Queue the making of the report's text, which comes back to be printed."""
        make = partial(report_text, *self._reported(numbers), self._tried)

        def work(report: Report, cancelled: Asked) -> Event:
            return Event(Kind.PRINT, self._do(make, report, cancelled))

        self.jobs.submit("report", work, "export")

    @property
    def _tried(self) -> tuple[str, ...]:
        return self.session.effects.tried

    def _reported(self, numbers: Sequence[int]) -> tuple[list[Shot], Diagnosis | None]:
        entries = self._entries(numbers) or list(self.session.entries)
        shots = [replace(entry.shot, note=entry.note) for entry in entries if entry.shot is not None]
        chosen = {entry.number for entry in entries}
        found = next((found for found in self.diagnoses[::-1] if set(found.numbers) <= chosen), None)
        return shots, found.diagnosis if found is not None else None

    # what ended -------------------------------------------------------------------------------------------------

    def poll(self) -> list[Event]:
        """Return what ended since the last call."""
        for job in (*self.jobs.finished(), *self.errands.finished()):
            if job.cancelled:
                continue
            if job.problem is not None:
                self._waiting.append(Event(Kind.PROBLEM, f"{job.name}: {job.problem}"))
            elif job.result is not None:
                self._take(job)
        happened, self._waiting = self._waiting, []
        return happened

    def _take(self, job: Job) -> None:
        result = job.result
        if isinstance(result, InSession):
            if result.turn != self._turn:
                return
            result = result.result
        if isinstance(result, Event):
            self._waiting.append(result)
        elif isinstance(result, Diagnosed):
            self.diagnoses.append(result)
            self._keep_diagnosis(result)
            for number in result.numbers:
                self.session.set_verdict(number, verdict_words(result.diagnosis))
            self._waiting.append(Event(Kind.DIAGNOSED, result.diagnosis.sentence, result.numbers))
        elif isinstance(result, SavedElsewhere):
            self._take_saved(result)
        elif isinstance(result, Loaded):
            self.known = result.model
            self._use(result.model.base, result.model.effects, result.model.tried)
            words = f"Model {model_words(result.model)}, taken from {result.path}"
            self._waiting.append(Event(Kind.MODEL, words))
        elif isinstance(result, Opened):
            entry = self.session.add(result.shot, copy_of=result.copy_of)
            self._keep([result.shot])
            self._waiting.append(Event(Kind.SHOT, f"{entry.name} opened", (entry.number,)))
        elif isinstance(result, Filled):
            for number, shot in result.shots:
                self.session.fill(number, shot)
            self._keep([shot for _, shot in result.shots])
            self._waiting.append(Event(Kind.CHANGED, "", tuple(number for number, _ in result.shots)))

        elif isinstance(result, Reopened):
            self._take_reopened(result)

    def _take_reopened(self, result: Reopened) -> None:
        for number, shot, version in result.shots:
            self.session.fill(number, shot, version)
        for number in result.missing:
            entry = self.session.entry(number)
            if entry is not None and entry.shot is None:
                self._submit_fill(entry)
        self.diagnoses[:0] = result.diagnosed  # what was found meanwhile is newer
        if result.shots or result.diagnosed:
            self._waiting.append(Event(Kind.CHANGED, "", tuple(number for number, *_ in result.shots)))

    def _take_saved(self, result: SavedElsewhere) -> None:
        for name, path in result.paths.items():
            if not self.session.set_path(name, str(path)):
                self._paths_ahead[name] = str(path)  # its analysis is still under way
        count = len(result.paths)
        words = f"{count} shot{'s' if count > 1 else ''} saved to {result.folder}" if count else "no shot waits"
        if result.problem is None:
            self._waiting.append(Event(Kind.EXPORTED, words))
        else:
            before = f"{words}; " if count else ""
            self._waiting.append(Event(Kind.PROBLEM, f"{before}the rest stays in memory: {result.problem}"))

    # the jobs ---------------------------------------------------------------------------------------------------

    def _entries(self, numbers: Sequence[int]) -> list[Entry]:
        return [entry for entry in self.session.entries if entry.number in numbers]

    def _do(self, work: Callable[..., Any], report: Report, cancelled: Asked) -> Any:
        """Do the long part of a job where the screen does not feel it; called in the jobs' thread."""
        if self._apart is not None:
            return self._apart.run(work, report, cancelled)
        return work(progress=report, cancelled=cancelled)

    def aside(self, name: str, work: Callable[..., Any], kind: str) -> Job:
        """Queue long work, called with ``progress`` and ``cancelled``, whose result the one who asks takes himself."""
        return self.jobs.submit(name, lambda report, cancelled: self._do(work, report, cancelled), kind)

    def _submit(self, jobs: Jobs, name: str, work: Callable[[Report, Asked], object], kind: str) -> None:
        """Queue work on the shots of the session now open: once another is, its result concerns nobody."""
        turn = self._turn
        jobs.submit(name, lambda report, cancelled: InSession(turn, work(report, cancelled)), kind)

    def _submit_export(self, name: str, write: Callable[..., str]) -> None:
        def work(report: Report, cancelled: Asked) -> Event:
            return Event(Kind.EXPORTED, self._do(write, report, cancelled))

        self.jobs.submit(name, work, "export")

    def _submit_open(self, path: Path, settings: AnalysisSettings, copy_of: int | None = None) -> None:
        opening = partial(open_shot, path, settings, self.session.effects)

        def work(report: Report, cancelled: Asked) -> Opened:
            return Opened(self._do(opening, report, cancelled), copy_of)

        self._submit(self.jobs, path.name, work, "open")

    def _submit_fill(self, entry: Entry) -> None:
        number, effects = entry.number, self.session.effects
        opening = partial(open_shot, Path(entry.path or ""), entry.settings, effects)

        def work(report: Report, cancelled: Asked) -> Filled:
            return Filled(((number, self._do(opening, report, cancelled)),))

        self._submit(self.jobs, entry.name, work, "open")

    def _submit_refit(self, entries: Sequence[Entry]) -> None:
        wanted = self.session.effects

        def work(report: Report, cancelled: Asked) -> Filled:
            done: list[tuple[int, Shot]] = []
            for place, entry in enumerate(entries):
                shot = entry.shot
                effects = () if shot is None else wanted.of(shot.settings.model)
                if shot is None or shot.motion is None or shot.settings.effects == effects:
                    continue
                report(f"fitting {entry.name}", place / len(entries))
                done.append((entry.number, self._do(partial(refit_shot, shot, effects), report, cancelled)))
            return Filled(tuple(done))

        self._submit(self.jobs, "fit with the new model", work, "refit")


def _reopened(
    results: Results, numbers: Sequence[int], keys: Mapping[int, Key], _: Report, cancelled: Asked
) -> Reopened:
    """Read what was kept of these entries."""
    shots: list[tuple[int, Shot, str]] = []
    for number in numbers:
        kept = None if cancelled() else results.shot(keys[number])
        if kept is not None:
            shots.append((number, kept.shot, kept.version))
    done = {number for number, *_ in shots}
    return Reopened(tuple(shots), tuple(number for number in numbers if number not in done))


def _diagnoses(results: Results, keys: Mapping[int, Key], _: Report, __: Asked) -> Reopened:
    """Read the diagnoses that were kept of these entries."""
    number_of = {key.bare: number for number, key in keys.items()}
    kept = results.diagnoses(keys.values())
    found = (Diagnosed(one.diagnosis, tuple(number_of[key] for key in one.of), one.version) for one in kept)
    return Reopened((), (), tuple(found))
