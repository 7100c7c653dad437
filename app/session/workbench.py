"""What the window does with shots away from the rig: open, re-analyse, diagnose.

``model`` changes the model, ``papers`` writes what leaves the program, ``elsewhere`` saves what is only in memory.

Plain Python: every piece of work is a job, done in a process of its own where there is one, and comes back as a
Event that the screen polls.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from analysis.fitted.awaited_fit import awaits_fit
from analysis.fitted.fitted_shot import shaking_of
from analysis.shot.plates_of_set import why_not_together
from analysis.shot.shot import AnalysisSettings, Shot
from app.session.event import Diagnosed, Event, Filled, Kind, Loaded, Opened, Refitted, Reopened, SavedElsewhere
from app.session.jobs import Asked, Job, Report, Saver, Work
from app.session.load import unanalysed
from app.session.model_in_use import OwnLaws
from app.session.model_work import ModelWork
from app.session.own_session import Unlisted, held, listed_by, named_session, own_session, unlisted
from app.session.papers import Elsewhere, Papers
from app.session.results import KeptWork, Key, Results
from app.session.session import Entry, Session
from app.session.settings import correction_words
from app.session.shot_work import diagnose_motions, open_shot
from app.session.verdict_of import Diagnoses, verdict_of
from app.session.why import Why
from app.words.verdict import verdict_words
from instrument.capture.analyst import STOPPED
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import find_recordings, rewrite_note
from instrument.process.work import WorkApart

MOST_NAMED = 6  # shots, in the name of a diagnosis under way
SAVE_AGAIN_S = 5.0  # after saving the session failed: the disk may have room again


class Workbench:
    """The session, and all work on its shots."""

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
        if saver is not None:
            session.save_by = saver.submit
        self.own_laws = own_laws or OwnLaws(None)
        self._work = Work(apart)
        self.jobs, self.errands = self._work.jobs, self._work.errands
        self.model = ModelWork(session, self._work)
        self._kept = KeptWork(results, self._work) if results is not None else None
        self._usual = session.path.parent if session.path is not None else None
        self.diagnoses = Diagnoses()
        self.why = Why(self._work)
        self.papers = Papers(session, self._work, self.diagnoses)
        self.elsewhere = Elsewhere(session, self.errands)
        self._settings, self._again = settings, again or settings
        self._waiting: list[Event] = []
        self._takers: dict[type, Callable[[Any], object]] = {  # what each kind of result is taken by
            Event: lambda result: self._waiting.append(result),
            Diagnosed: self._take_diagnosed,
            SavedElsewhere: lambda result: self._waiting.append(self.elsewhere.take(result)),
            Loaded: lambda result: self._waiting.append(self.model.take(result)),
            Opened: self._take_opened,
            Filled: self._take_filled,
            Refitted: self._take_refitted,
            Reopened: self._take_reopened,
            Unlisted: self._take_unlisted,
        }
        self._tried_at_s = -SAVE_AGAIN_S  # when a session that could not be saved was last saved again
        self._captured: dict[tuple[str, str | None], int] = {}  # numbers of shots that wait for the rig's analysis

    def close(self) -> bool:
        """Cancel all work and wait for it; return whether the threads ended."""
        ended = self._work.close()
        self.session.save_again()
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
            return "this window has no session file"
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
        self._work.another_session()
        self.model.forget()
        self.diagnoses.clear()
        self._captured.clear()  # what the rig still analyses joins the session that is open then
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
        if self._kept is not None:
            self._kept.ask({entry.number: self._key(entry) for entry in unread})
            return
        for entry in unread:
            self._submit_fill(entry)

    def _key(self, entry: Entry) -> Key:
        """Return what an entry's result is kept under."""
        effects = self.model.effects_of(entry.settings.model)
        return Key(entry.path or "", replace(entry.settings, effects=effects))

    def _keep(self, shots: Sequence[Shot]) -> None:
        if self._kept is not None:
            self._kept.keep(shots)

    def look_for_unlisted(self, folder: Path, sessions: Sequence[Path] = ()) -> None:
        """Queue a look for recordings in ``folder`` that neither this session nor one of these files lists."""
        own = {entry.path for entry in self.session.entries if entry.path is not None} | {*self.session.left_out}
        now_s = time.time()

        def work(_: Report, __: Asked) -> Unlisted:
            return unlisted(folder, own | listed_by(sessions), now_s)

        self.errands.submit("recordings not in any session", work, "look")

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

    def add_captured(self, name: str, path: Path | None) -> Entry:
        """List a shot as soon as the rig captured it: whatever becomes of its analysis, it is in the session."""
        where = None if path is None else str(path)
        entry = self.session.add_captured(name, where, self._settings())
        self._captured[name, where] = entry.number
        return entry

    def add_shot(self, shot: Shot) -> Entry | None:
        """Take a shot that the rig captured and analysed, in its place where it is listed; the model may have changed.

        None where it was taken off the list meanwhile.
        """
        where = None if shot.path is None else str(Path(shot.path))
        number = self._captured.pop((shot.name, where), None)
        if number is None:
            path = self.elsewhere.path_of(shot.name) if shot.path is None else None
            entry = self.session.add(shot if path is None else replace(shot, path=path))
        elif self.session.entry(number) is None:
            self._keep([shot])
            return None
        else:
            entry = self.session.complete(number, shot)
        if not awaits_fit(shot):
            self._whole(entry)
        return entry

    def take_fit(self, shot: Shot) -> Entry | None:
        """Take the fit that a captured shot awaited; return its entry, None where that awaits it no more."""
        awaiting = self.session.awaiting(shot)
        if awaiting is None:
            return None
        if shot.fit_problem == STOPPED:  # Abort frees the rig: the fit that was under way is made beside it
            self.model.catch_up(also=[awaiting])
            return awaiting
        self.session.fill(awaiting.number, replace(shot, path=awaiting.path))
        entry = self.session.entry(awaiting.number)
        assert entry is not None
        self._whole(entry)
        return entry

    def _whole(self, entry: Entry) -> None:
        """Keep the result of a captured shot, once the model as it is now is fitted to it."""
        shot = entry.shot
        assert shot is not None
        if self.model.is_behind(entry):
            self.model.catch_up()
        else:
            self._keep([shot])

    def add_unanalysed(self, path: Path | None, problem: str, name: str) -> Entry | None:
        """Take a shot that the rig captured and nobody analysed: ``reanalyse`` does."""
        words = f"{problem}: analyse it again (Ctrl+R)"
        return self.add_shot(unanalysed(path, self._settings(), words, name))

    def diagnose(self, numbers: Sequence[int]) -> str | None:
        """Queue the diagnosis of these entries; return why not, or None."""
        chosen = [entry for entry in self._entries(numbers) if entry.shot is not None and entry.shot.motion is not None]
        if not chosen:
            return "select at least one analysed shot"
        shots = [entry.shot for entry in chosen if entry.shot is not None]
        if why := why_not_together(shots):
            return why
        motions = [shot.motion for shot in shots if shot.motion is not None]
        ids = tuple(entry.number for entry in chosen)
        model = chosen[0].settings.model
        laws, problems = self.own_laws.keys()
        self._waiting += [Event(Kind.PROBLEM, problem) for problem in problems]
        shakings = [shaking_of(shot) for shot in shots]
        accepted = self.model.effects_of(model)
        seconds = self._settings().diagnosis_seconds  # as it is now, not as it was when the shots were taken
        judging = partial(diagnose_motions, motions, model, accepted, laws, shakings, seconds)

        def work(report: Report, cancelled: Asked) -> Diagnosed:
            return Diagnosed(self._work.do(judging, report, cancelled), ids)

        which = ", ".join(str(number) for number in ids[:MOST_NAMED])
        more = f" and {len(ids) - MOST_NAMED} more" if len(ids) > MOST_NAMED else ""
        name = f"diagnosis of shot{'s' if len(ids) > 1 else ''} {which}{more}"
        self._work.submit(self.jobs, name, work, "diagnosis")
        return None

    def set_note(self, number: int, note: str) -> None:
        """Keep the operator's note in the session, and in the recording by an errand, which waits for no long work."""
        self.session.set_note(number, note)
        entry = self.session.entry(number)
        if entry is not None:
            self._write_note(entry)

    def _write_note(self, entry: Entry) -> None:
        """Write a shot's note into its recording, where that has one, by an errand."""
        if entry.path is None or not entry.path.endswith(".sigmf-meta"):
            return
        path, note = Path(entry.path), entry.note

        def work(_: Report, __: Asked) -> None:
            rewrite_note(path, note)  # RecordingError, which the job's problem says, where it is read-only

        self.errands.submit(f"note of {entry.name}", work, "note")

    def undo(self) -> str | None:
        """Take back the last note, removal or change of the model; return what it was, or None."""
        return self._stepped(self.session.undo)

    def redo(self) -> str | None:
        """Do again what was undone last; return what it is, or None."""
        return self._stepped(self.session.redo)

    def _stepped(self, step: Callable[[], str | None]) -> str | None:
        there = {entry.number for entry in self.session.entries} | set(self._captured.values())
        notes = {entry.number: entry.note for entry in self.session.entries}
        what = step()
        for entry in self.session.entries:
            if notes.get(entry.number, entry.note) != entry.note:
                self._write_note(entry)
        for entry in self.session.entries:  # its analysis may have come while it was off the list
            if entry.shot is None and entry.path is not None and entry.number not in there:
                self._submit_fill(entry)
        # shots that come back to the list: the fit that they awaited may have come while they were off it
        self.model.catch_up(also=self.session.entries)
        return what

    # what ended -------------------------------------------------------------------------------------------------

    def poll(self) -> list[Event]:
        """Return what ended since the last call."""
        for job, result in self._work.ended():
            if job.problem is not None:
                self._waiting.append(Event(Kind.PROBLEM, f"{job.name}: {job.problem}"))
            else:
                self._take(result)
        if self.session.unsaved and time.monotonic() - self._tried_at_s > SAVE_AGAIN_S:
            self._tried_at_s = time.monotonic()
            self.session.save_again()
        happened, self._waiting = self._waiting, []
        return happened

    def _take(self, result: object) -> None:
        if (take := self._takers.get(type(result))) is not None:
            take(result)

    def _take_diagnosed(self, result: Diagnosed) -> None:
        self.diagnoses.append(result)
        if self._kept is not None:
            entries = filter(None, map(self.session.entry, result.numbers))
            self._kept.keep_diagnosis(result, [self._key(entry) for entry in entries if entry.path is not None])
        of = verdict_of(result.diagnosis, result.numbers)
        for number in result.numbers:
            self.session.set_verdict(number, verdict_words(result.diagnosis.verdict, of.found), of)
        self._waiting.append(Event(Kind.DIAGNOSED, result.diagnosis.sentence, result.numbers))
        if result.diagnosis.not_asked:
            self._waiting.append(Event(Kind.PROBLEM, f"no time for {'; '.join(result.diagnosis.not_asked)} (F2)"))

    def _take_opened(self, result: Opened) -> None:
        entry = self.session.add(result.shot, copy_of=result.copy_of)
        self._keep([result.shot])
        self.model.catch_up()
        self._waiting.append(Event(Kind.SHOT, f"{entry.name} opened", (entry.number,)))

    def _take_refitted(self, result: Refitted) -> None:
        shot = self.model.take_fit(result)
        if shot is not None:
            self._keep([shot])
            self._waiting.append(Event(Kind.CHANGED, "", (result.number,)))

    def _take_filled(self, result: Filled) -> None:
        entry = self.session.entry(result.number)
        if entry is None or (entry.shot is not None and entry.shot.motion is not None):
            return  # taken off the list, or there already
        self.session.fill(result.number, result.shot)
        self._keep([result.shot])
        self.model.catch_up()
        self._waiting.append(Event(Kind.CHANGED, "", (result.number,)))

    def _take_unlisted(self, result: Unlisted) -> None:
        if result.cut_off:
            words = f"The program ended while it recorded {_named(result.cut_off)}: saved up to that point"
            self._waiting.append(Event(Kind.UNLISTED, words, paths=result.cut_off))
        if result.complete:
            count = len(result.complete)
            which = "1 recording" if count == 1 else f"{count} recordings"
            words = f"{which} in the data folder not in any session: {_named(result.complete)}"
            self._waiting.append(Event(Kind.UNLISTED, words, paths=result.complete))

    def _take_reopened(self, result: Reopened) -> None:
        for number, shot, version in result.shots:
            there = self.session.entry(number)
            if there is not None and there.shot is None:
                self.session.fill(number, shot, version)
        self.model.catch_up()
        for number in result.missing:
            entry = self.session.entry(number)
            if entry is not None and entry.shot is None:
                self._submit_fill(entry)
        self.diagnoses[:0] = result.diagnosed  # what was found meanwhile is newer
        if result.shots or result.diagnosed:
            self._waiting.append(Event(Kind.CHANGED, "", tuple(number for number, *_ in result.shots)))

    # the jobs ---------------------------------------------------------------------------------------------------

    def _entries(self, numbers: Sequence[int]) -> list[Entry]:
        return [entry for entry in self.session.entries if entry.number in numbers]

    def aside(self, name: str, work: Callable[..., Any], kind: str) -> Job:
        """Queue long work, called with ``progress`` and ``cancelled``, whose result the one who asks takes himself."""
        return self.jobs.submit(name, lambda report, cancelled: self._work.do(work, report, cancelled), kind)

    def _submit_open(self, path: Path, settings: AnalysisSettings, copy_of: int | None = None) -> None:
        opening = partial(open_shot, path, settings, self.session.effects)

        def work(report: Report, cancelled: Asked) -> Opened:
            return Opened(self._work.do(opening, report, cancelled), copy_of)

        self._work.submit(self.jobs, path.name, work, "open")

    def _submit_fill(self, entry: Entry) -> None:
        number, effects = entry.number, self.session.effects
        opening = partial(open_shot, Path(entry.path or ""), entry.settings, effects)

        def work(report: Report, cancelled: Asked) -> Filled:
            return Filled(number, self._work.do(opening, report, cancelled))

        self._work.submit(self.jobs, entry.name, work, "open")


def _named(paths: Sequence[Path]) -> str:
    """Return the names of the first recordings and how many there are besides."""
    names = ", ".join(path.name.removesuffix(".sigmf-meta") for path in paths[:3])
    return names + (f" and {len(paths) - 3} more" if len(paths) > 3 else "")
