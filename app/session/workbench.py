"""Commands on a session's shots: open, repeat the analysis, diagnose, edit notes, undo.

``model`` changes the model, ``exports`` writes files, ``unsaved`` saves shots that are only in memory.  Work runs in
background jobs, in a subprocess where one is given.  Each job ends with an Event; the window polls the events.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from analysis.diagnosis import Diagnosis
from analysis.fitted import fit_pending
from analysis.shot import AnalysisSettings, Shot, why_no_joint_fit
from app.session.candidate_residuals import CandidateResiduals
from app.session.entry import Entry
from app.session.exports import Exports, UnsavedShots
from app.session.jobs import Event, EventKind, JobQueues, OnResult, Saver
from app.session.load import load_and_analyse, unanalysed
from app.session.model_in_use import OwnLaws
from app.session.model_work import ModelWork
from app.session.result_cache import CachedShot, Key, ResultCache
from app.session.session import Session
from app.session.session_files import Unlisted, listed_by, lock_session, named_session, own_session, unlisted
from app.session.settings import correction_words
from app.session.spool import Spool
from app.session.verdict_basis import Diagnosed, Diagnoses, diagnose_shots, verdict_of
from app.words import listed
from instrument.capture import CapturedShot
from instrument.files import RecordingError, find_recordings, recording_stem, rewrite_note
from instrument.process import SubprocessWorker

AT_ONCE = 10  # cached results read by one job
MAX_NAMED = 6  # most shots listed in the name of a running diagnosis
SAVE_AGAIN_S = 5.0  # interval between attempts to save a session that could not be saved


class Workbench:
    """A session, its diagnoses, and the background jobs on its shots."""

    def __init__(
        self,
        session: Session,
        settings: Callable[[], AnalysisSettings],
        saver: Saver | None = None,
        subprocess_worker: SubprocessWorker | None = None,
        again: Callable[[], AnalysisSettings] | None = None,
        results: ResultCache | None = None,
        own_laws: OwnLaws | None = None,
        spool: Spool | None = None,
    ) -> None:
        """``saver`` saves the session in its own thread; ``subprocess_worker`` does long work, None: a thread.

        ``again`` returns the settings for a repeated analysis, with corrections of the rig; default: ``settings``.
        ``results`` is the cache for the next start; ``own_laws`` are the user's laws, which a diagnosis also tries;
        ``spool`` keeps the arrays of shots and diagnoses in files, None: they stay in memory.
        """
        self.session = session
        self._saver = saver
        if saver is not None:
            session.save_by = saver.submit
        self._spool = spool
        if spool is not None:
            session.spool_arrays = spool.moved
        self.own_laws = own_laws or OwnLaws(None)
        self._work = JobQueues(subprocess_worker)
        self.jobs, self.short_jobs, self.submit_long = self._work.jobs, self._work.short_jobs, self._work.submit_long
        self.model = ModelWork(session, self._work, self._notify, self._changed)
        self._results = results
        self._usual = session.path.parent if session.path is not None else None
        self.diagnoses = Diagnoses()
        self.candidate_residuals = CandidateResiduals(self._work)
        self.exports = Exports(session, self._work, self.diagnoses, self._notify)
        self.unsaved = UnsavedShots(session, self.short_jobs, self._notify)
        self._settings, self._again = settings, again or settings
        self._waiting: list[Event] = []
        self._tried_at_s = -SAVE_AGAIN_S  # monotonic time of the last repeated attempt to save the session
        self._awaiting: dict[int, int] = {}  # number of a rig's shot -> entry that awaits its readings or its fit

    def close(self) -> bool:
        """Cancel all jobs and wait for the threads; return whether they ended."""
        ended = self._work.close()
        self.session.save_again()
        ended &= self._saver is None or self._saver.close()
        self.session.unlock()
        return ended

    # sessions ---------------------------------------------------------------------------------------------------

    def open_session(self, path: Path) -> str | None:
        """Open a session file; return an error message, or None."""
        if self.session.path is not None and path.absolute() == self.session.path.absolute():
            return None
        try:
            other = named_session(path)
        except RecordingError as error:
            return str(error)
        self._switch_to(other)
        return other.problem

    def open_unnamed_session(self) -> str | None:
        """Open the unnamed session; return an error message, or None."""
        if self._usual is None:
            return "this window has no session file"
        self._switch_to(own_session(self._usual))
        return self.session.problem

    def save_session(self, path: Path) -> str | None:
        """Save the session to another file from now on; return an error message, or None."""
        if path.absolute() == (self.session.path or Path()).absolute():
            return None
        try:
            self.session.move_to(path, lock_session(path))
        except RecordingError as error:
            return str(error)
        return self.session.problem

    def _switch_to(self, other: Session) -> None:
        self._work.cancel_session_jobs()
        self.model.forget()
        self.diagnoses.clear()
        self._awaiting.clear()  # shots still being analysed are added to the new session
        self.session.switch_to(other)
        self.read_unread()

    # commands --------------------------------------------------------------------------------------------------

    def open_paths(self, paths: Sequence[Path]) -> int:
        """Queue the analysis of every recording under these files and folders; return their number."""
        found = find_recordings(paths)
        for path in found:
            self._submit_open(path, self._settings())
        return len(found)

    def read_unread(self) -> None:
        """Queue the reading of a reopened session's entries, from the cache if one is given.

        The last entry is read from the cache first, because the session opens at its last shot.
        """
        unread = [entry for entry in self.session.entries if entry.shot is None and entry.path is not None]
        if (results := self._results) is None:
            for entry in unread:
                self._submit_fill(entry)
            return
        keys = {entry.number: self._key(entry) for entry in unread}
        newest = list(keys.items())[::-1]
        for start in range(0, len(newest), AT_ONCE):
            reading = partial(results.shots, dict(newest[start : start + AT_ONCE]))
            self.short_jobs.submit("reading cached results", reading, "kept", self._take_cached)
        self.short_jobs.submit(
            "reading cached diagnoses", lambda _, __: results.diagnoses(keys), "kept", self._take_cached_diagnoses
        )

    def _key(self, entry: Entry) -> Key:
        """Return the cache key of an entry's result."""
        effects = self.session.effects.of(entry.settings.model)
        return Key(entry.path or "", replace(entry.settings, effects=effects))

    def _keep(self, shot: Shot | None) -> None:
        if (results := self._results) is not None and shot is not None:
            self.short_jobs.submit("saving results to the cache", lambda _, __: results.store_shot(shot), "keep")

    def find_unlisted(self, folder: Path, sessions: Sequence[Path] = ()) -> None:
        """Queue a search for recordings in ``folder`` that neither this session nor ``sessions`` list."""
        own = {entry.path for entry in self.session.entries if entry.path is not None} | {*self.session.dismissed}
        now_s = time.time()
        self.short_jobs.submit(
            "recordings not in any session",
            lambda _, __: unlisted(folder, own | listed_by(sessions), now_s),
            "look",
            self._take_unlisted,
        )

    def reanalyse(self, numbers: Sequence[int]) -> int:
        """Queue the analysis of copies of these entries with the present settings; return their number.

        An entry without an analysed motion is not copied: it takes the result itself.
        """
        count = 0
        for entry in self.session.entries_with(numbers):
            if entry.path is None:
                continue
            if entry.shot is not None and entry.shot.motion is None:
                self._submit_fill(replace(entry, settings=self._again()))
            else:
                self._submit_open(Path(entry.path), self._again(), copy_of=entry.number)
            count += 1
        return count

    def corrections_in_words(self) -> str:
        """Return the rig values that a repeated analysis would correct, in words; "" for none."""
        return ", ".join(correction_words(self._again().corrections))

    def add_captured(self, captured: CapturedShot) -> Entry:
        """Add a shot of the rig to the session before its analysis."""
        where = None if captured.path is None else str(captured.path)
        entry = self.session.add_captured(captured.name, where, self._settings())
        self._awaiting[captured.number] = entry.number
        return entry

    def add_shot(self, shot: Shot, of: int | None = None) -> Entry | None:
        """Store an analysed shot in the entry of the rig's shot number ``of``, or in a new one; return the entry.

        Returns None if the entry was removed in the meantime.
        """
        number = None if of is None else self._awaiting.pop(of, None)
        if number is None:
            entry = self.session.add(replace(shot, path=shot.path or self.unsaved.path_of(shot.name)))
        elif self.session.entry(number) is None:
            self._keep(shot)
            return None
        else:
            entry = self.session.fill(number, shot, note=shot.note)
        if not fit_pending(shot):
            self._store_or_refit(entry)
        elif of is not None:
            self._awaiting[of] = entry.number
        return entry

    def take_fit(self, shot: Shot, of: int) -> Entry | None:
        """Store the fit of the rig's shot number ``of``; return its entry, or None if no entry awaits this fit."""
        awaiting = self.session.entry(self._awaiting.pop(of, 0))
        if awaiting is None or awaiting.shot is None or not fit_pending(awaiting.shot):
            return None
        if shot.fit_stopped:  # Abort stopped the fit; a background job repeats it
            self.model.refit_outdated(also=[awaiting])
            return awaiting
        entry = self.session.fill(awaiting.number, shot)
        self._store_or_refit(entry)
        return entry

    def _store_or_refit(self, entry: Entry) -> None:
        """Cache the result of a captured shot, or refit the shot if the model has changed."""
        if self.model.needs_refit(entry):
            self.model.refit_outdated()
        else:
            self._keep(entry.shot)

    def add_unanalysed(self, captured: CapturedShot) -> Entry | None:
        """Add a shot that the rig captured but could not analyse."""
        words = f"{captured.problem or 'not analysed'}: analyse it again (Ctrl+R)"
        return self.add_shot(unanalysed(captured.path, self._settings(), words, captured.name), captured.number)

    def diagnose(self, numbers: Sequence[int]) -> str | None:
        """Queue the joint diagnosis of these entries; return an error message, or None."""
        entries = self.session.entries_with(numbers)
        chosen = [entry for entry in entries if entry.shot is not None and entry.shot.motion is not None]
        if not chosen:
            return "select at least one analysed shot"
        shots = [entry.shot for entry in chosen if entry.shot is not None]
        if why := why_no_joint_fit(shots):
            return why
        ids = tuple(entry.number for entry in chosen)
        laws, problems = self.own_laws.read()
        for problem in problems:
            self._notify(EventKind.PROBLEM, problem)
        accepted = self.session.effects.of(shots[0].settings.model)
        seconds = self._settings().diagnosis_seconds  # the present setting, not the one stored with the shots
        judging = partial(diagnose_shots, shots, accepted, laws, seconds)
        name = f"diagnosis of shot{'s' if len(ids) > 1 else ''} {listed([*map(str, ids)], MAX_NAMED)}"
        self.submit_long(name, judging, "diagnosis", partial(self._take_diagnosis, ids))
        return None

    def set_note(self, number: int, note: str) -> None:
        """Set the operator's note in the session and, by a short job, in the recording."""
        self.session.set_note(number, note)
        entry = self.session.entry(number)
        if entry is not None:
            self._write_note(entry)

    def _write_note(self, entry: Entry) -> None:
        """Queue the writing of a note into the recording's metadata."""
        if entry.path is None or not entry.path.endswith(".sigmf-meta"):
            return
        path, note = Path(entry.path), entry.note
        # raises RecordingError if the file is read-only
        self.short_jobs.submit(f"note of {entry.name}", lambda _, __: rewrite_note(path, note), "note")

    def undo(self) -> str | None:
        """Undo the last note, removal or model change; return its name, or None."""
        return self._undo_or_redo(self.session.undo)

    def redo(self) -> str | None:
        """Redo the last undone change; return its name, or None."""
        return self._undo_or_redo(self.session.redo)

    def _undo_or_redo(self, step: Callable[[], str | None]) -> str | None:
        there = {entry.number for entry in self.session.entries} | set(self._awaiting.values())
        notes = {entry.number: entry.note for entry in self.session.entries}
        what = step()
        for entry in self.session.entries:
            if notes.get(entry.number, entry.note) != entry.note:
                self._write_note(entry)
        for entry in self.session.entries:  # the analysis may have finished while the entry was removed
            if entry.shot is None and entry.path is not None and entry.number not in there:
                self._submit_fill(entry)
        # fits of restored entries may have finished while the entries were removed
        self.model.refit_outdated(also=self.session.entries)
        return what

    # results ----------------------------------------------------------------------------------------------------

    def poll(self) -> list[Event]:
        """Return the events since the last call."""
        if self._spool is not None:
            self._spool.release()
        for problem in self._work.collect_results():
            self._notify(EventKind.PROBLEM, problem)
        if self.session.unsaved and time.monotonic() - self._tried_at_s > SAVE_AGAIN_S:
            self._tried_at_s = time.monotonic()
            self.session.save_again()
        events, self._waiting = self._waiting, []
        return events

    def _notify(self, kind: EventKind, words: str, numbers: tuple[int, ...] = (), paths: tuple[Path, ...] = ()) -> None:
        self._waiting.append(Event(kind, words, numbers, paths))

    def _changed(self, entry: Entry) -> None:
        """Cache an entry's new shot and report the change to the window."""
        self._keep(entry.shot)
        self._notify(EventKind.CHANGED, "", (entry.number,))

    def _take_diagnosis(self, numbers: tuple[int, ...], diagnosis: Diagnosis) -> None:
        result = self._held(Diagnosed(diagnosis, numbers))
        self.diagnoses.append(result)
        keys = [self._key(entry) for entry in filter(None, map(self.session.entry, numbers)) if entry.path is not None]
        if (results := self._results) is not None and len(keys) == len(numbers):
            self.short_jobs.submit(
                "saving a diagnosis to the cache", lambda _, __: results.store_diagnosis(result.diagnosis, keys), "keep"
            )
        of = verdict_of(diagnosis, numbers)
        for number in numbers:
            self.session.set_verdict(number, of)
        self._notify(EventKind.DIAGNOSED, diagnosis.sentence, numbers)
        if diagnosis.not_asked:
            words = f"not computed within the diagnosis time limit (F2): {'; '.join(diagnosis.not_asked)}"
            self._notify(EventKind.PROBLEM, words)

    def _held(self, found: Diagnosed) -> Diagnosed:
        return found if self._spool is None else replace(found, diagnosis=self._spool.moved(found.diagnosis))

    def _take_opened(self, copy_of: int | None, shot: Shot) -> None:
        entry = self.session.add(shot, copy_of=copy_of)
        self._keep(entry.shot)
        self.model.refit_outdated()
        self._notify(EventKind.SHOT, f"{entry.name} opened", (entry.number,))

    def _take_filled(self, number: int, shot: Shot) -> None:
        entry = self.session.entry(number)
        if entry is None or (entry.shot is not None and entry.shot.motion is not None):
            return  # the entry was removed or is already analysed
        filled = self.session.fill(number, shot)
        self.model.refit_outdated()
        self._changed(filled)

    def _take_unlisted(self, result: Unlisted) -> None:
        if result.cut_off:
            words = f"The program stopped while recording {_named(result.cut_off)}; the saved part can be opened"
            self._notify(EventKind.UNLISTED, words, paths=result.cut_off)
        if result.complete:
            count = len(result.complete)
            which = "1 recording in the data folder is" if count == 1 else f"{count} recordings in the data folder are"
            words = f"{which} in no session: {_named(result.complete)}"
            self._notify(EventKind.UNLISTED, words, paths=result.complete)

    def _take_cached(self, cached: dict[int, CachedShot | None]) -> None:
        """Set the shots of entries found in the cache, and queue the analysis of the other entries."""
        waiting = [entry for number in cached if (entry := self.session.entry(number)) is not None]
        waiting = [entry for entry in waiting if entry.shot is None]
        for entry in waiting:
            if (kept := cached[entry.number]) is not None:
                shot, version = kept
                self.session.fill(entry.number, shot, version=version)
        self.model.refit_outdated()
        for entry in waiting:
            if cached[entry.number] is None:
                self._submit_fill(entry)
        if found := tuple(number for number, kept in cached.items() if kept is not None):
            self._notify(EventKind.CHANGED, "", found)

    def _take_cached_diagnoses(self, found: list[Diagnosed]) -> None:
        self.diagnoses[:0] = map(self._held, found)  # in front, because diagnoses made since the start are newer
        if found:
            self._notify(EventKind.CHANGED, "")

    # the jobs ---------------------------------------------------------------------------------------------------

    def _submit_open(self, path: Path, settings: AnalysisSettings, copy_of: int | None = None) -> None:
        self._submit_reading(path, path.name, settings, partial(self._take_opened, copy_of))

    def _submit_fill(self, entry: Entry) -> None:
        take = partial(self._take_filled, entry.number)
        self._submit_reading(Path(entry.path or ""), entry.name, entry.settings, take)

    def _submit_reading(self, path: Path, name: str, settings: AnalysisSettings, take: OnResult) -> None:
        """Queue the analysis of a recording and its fit with the effects in the model."""
        reading = partial(load_and_analyse, path, settings=settings, effects_of=self.session.effects.of)
        self.submit_long(name, reading, "open", take)


def _named(paths: Sequence[Path]) -> str:
    """Return the names of the first three recordings and the number of others."""
    return listed([recording_stem(path).name for path in paths], 3)
