"""A session: its list of shots with notes and verdicts, saved at each change, with undo and redo."""

import os
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.shot import AnalysisSettings, PlotNote, Shot
from app.session.entry import Entry, entry_from_json, entry_to_json, keys_of, model_effects
from app.session.verdict_basis import ModelEffects, VerdictBasis
from instrument.files import CheckedTable, RecordingError, read_json, shown, write_json_atomic

SCHEMA = "levimass.session/1"
UNDO_DEPTH = 100
MAX_DISMISSED = 10_000


@dataclass(frozen=True, slots=True)
class _State:
    entries: tuple[Entry, ...]
    what: str
    effects: ModelEffects
    without: frozenset[int] = frozenset()  # entries to remove when this state is restored


class Session:
    """An ordered list of entries, changed only by the methods here and saved at each change before the call returns.

    If ``save_by`` is set, it saves later in another thread, and ``problem`` and ``revision`` change then.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path  # the session file
        self.entries: tuple[Entry, ...] = ()  # oldest first
        self.effects = ModelEffects()  # the effects in the model
        self._undo: list[_State] = []
        self._redo: list[_State] = []
        self.dismissed: tuple[str, ...] = ()  # paths not to be offered at the next start, newest last
        self._next = 0  # highest number ever used; numbers are not reused, because undo restores removed shots
        self.read_problem: str | None = None  # one line: why it could not be read, until it is saved
        self.save_problem: str | None = None  # one line: why the last attempt to save failed
        self.revision = 0
        self.spool_arrays: Callable[[Shot], Shot] = lambda shot: shot  # moves arrays out of memory (``Spool``)
        self.save_by: Callable[[Callable[[], None]], None] = lambda save: save()
        self.unlock: Callable[[], None] = lambda: None  # releases the lock on the session file

    def set_effects(self, effects: ModelEffects) -> None:
        """Set the effects in the model; can be undone."""
        if effects != self.effects:
            self._remember("the change of the model")
        self.effects = effects
        self._set(self.entries)

    @property
    def unsaved(self) -> bool:
        """Get whether the last attempt to save failed, so that the newest change is not on disk."""
        return self.save_problem is not None

    @property
    def problem(self) -> str | None:
        """Get one line on why the session could not be saved or read, or None."""
        return self.save_problem or self.read_problem

    @property
    def can_undo(self) -> bool:
        return bool(self._undo)

    def entry(self, number: int) -> Entry | None:
        return next((entry for entry in self.entries if entry.number == number), None)

    def entries_with(self, numbers: Collection[int]) -> list[Entry]:
        """Return the entries with these numbers, oldest first."""
        return [entry for entry in self.entries if entry.number in numbers]

    def shots(self, numbers: Sequence[int]) -> list[Shot]:
        """Return the shots of these entries, without entries not read yet, in the order of ``numbers``."""
        entries = (self.entry(number) for number in numbers)
        return [entry.shot for entry in entries if entry is not None and entry.shot is not None]

    def _new_number(self) -> int:
        self._next = 1 + max(self._next, *(entry.number for entry in self.entries), 0)
        return self._next

    def add(self, shot: Shot, copy_of: int | None = None) -> Entry:
        """Add an analysed shot and return its entry."""
        original = None if copy_of is None else self.entry(copy_of)
        on_plots = () if original is None else original.plot_notes
        shot = self.spool_arrays(shot)
        number = self._new_number()
        entry = Entry(number, shot.name, shot.path, shot.settings, shot, shot.note, on_plots, copy_of=copy_of)
        self._set((*self.entries, entry))
        return entry

    def add_captured(self, name: str, path: str | None, settings: AnalysisSettings) -> Entry:
        """Add a captured shot before its analysis; return its entry."""
        entry = Entry(self._new_number(), name, path, settings)
        self._set((*self.entries, entry))
        return entry

    def fill(self, number: int, shot: Shot, *, version: str = "", note: str = "") -> Entry:
        """Set the shot of an entry, with its ``note`` unless the entry has one; return the entry.

        ``version`` is the program version of a cached result, else "".
        """
        shot = self.spool_arrays(shot)

        def filled(entry: Entry) -> Entry:
            path = entry.path or shot.path  # the recording may have been saved to another folder in the meantime
            return replace(
                entry,
                shot=replace(shot, path=path),
                path=path,
                name=shot.name,
                settings=shot.settings,
                note=entry.note or note,
                version=version,
            )

        self._change(number, filled)
        entry = self.entry(number)
        assert entry is not None
        return entry

    def set_path(self, name: str, path: str) -> bool:
        """Set the path of the newest shot with this name that was only in memory; return whether one exists."""
        entry = next((e for e in reversed(self.entries) if e.name == name and e.path is None), None)
        if entry is not None:
            shot = None if entry.shot is None else replace(entry.shot, path=path)
            self._change(entry.number, lambda old: replace(old, path=path, shot=shot))
        return entry is not None

    def set_verdict(self, number: int, of: VerdictBasis) -> None:
        """Set the verdict on an entry, with the model and shots that the verdict refers to."""
        self._change(number, lambda entry: replace(entry, verdict_of=of))

    def verdict_is_valid(self, entry: Entry) -> bool:
        """Return whether an entry's verdict, if any, refers to the present model and only to shots in the session."""
        of = entry.verdict_of
        if of is None:
            return True
        return of.is_valid(self.effects.of(entry.settings.model), {other.number for other in self.entries})

    def set_note(self, number: int, note: str) -> None:
        """Set the operator's note; can be undone."""
        self._remember(f"the note of shot {number}")
        self._change(number, lambda entry: replace(entry, note=note))

    def change_plot_note(self, number: int, before: PlotNote | None, after: PlotNote | None) -> None:
        """Add a note to a shot's plots (``before`` None), change it, or remove it (``after`` None); can be undone."""
        entry = self.entry(number)
        if entry is None or before == after or (before is not None and before not in entry.plot_notes):
            return
        notes = list(entry.plot_notes)
        place = len(notes) if before is None else notes.index(before)
        notes[place : place + 1] = [] if after is None else [after]
        self._remember(f"the note on a plot of shot {number}")
        self._change(number, lambda old: replace(old, plot_notes=tuple(notes)))

    def remove(self, numbers: list[int]) -> None:
        """Remove entries from the list, not their recordings; can be undone."""
        self._remember("the removal")
        self.dismiss([entry.path for entry in self.entries if entry.number in numbers and entry.path])
        self._set(tuple(entry for entry in self.entries if entry.number not in numbers))

    def dismiss(self, paths: Sequence[str]) -> None:
        """Do not offer these recordings at the next start."""
        kept = [path for path in self.dismissed if path not in set(paths)]
        self.dismissed = (*kept, *dict.fromkeys(paths))[-MAX_DISMISSED:]
        self._save()

    def undo(self) -> str | None:
        """Undo the last note, removal or model change; return its name, or None."""
        return self._step(self._undo, self._redo)

    def redo(self) -> str | None:
        """Redo the last undone change; return its name, or None."""
        return self._step(self._redo, self._undo)

    def _step(self, back: list[_State], forth: list[_State]) -> str | None:
        """Restore the newest state of ``back`` and push the present one onto ``forth``; shots added since stay."""
        if not back:
            return None
        state = back.pop()
        there = {entry.number: entry for entry in self.entries}
        notes = {old.number: (old.note, old.plot_notes) for old in state.entries}
        returned = [old for old in state.entries if old.number not in there and old.number not in state.without]
        kept = [entry for entry in self.entries if entry.number not in state.without]
        for place, entry in enumerate(kept):
            note, on_plots = notes.get(entry.number, (entry.note, entry.plot_notes))
            kept[place] = replace(entry, note=note, plot_notes=on_plots)
        without = frozenset(entry.number for entry in returned)
        forth.append(_State(self.entries, state.what, self.effects, without))
        self.effects = state.effects
        self._set(tuple(sorted([*kept, *returned], key=lambda entry: entry.number)))
        return state.what

    def _remember(self, what: str) -> None:
        self._undo.append(_State(self.entries, what, self.effects))
        del self._undo[:-UNDO_DEPTH]
        self._redo.clear()

    def _change(self, number: int, change: Callable[[Entry], Entry]) -> None:
        self._set(tuple(change(entry) if entry.number == number else entry for entry in self.entries))

    def _set(self, entries: tuple[Entry, ...]) -> None:
        self.entries = entries
        self.revision += 1
        self._save()

    def _save(self) -> None:
        path, entries, effects, left_out = self.path, self.entries, self.effects, self.dismissed
        if path is not None:
            self.save_by(lambda: self._write(path, entries, effects, left_out))

    def save_again(self) -> None:
        """Repeat a failed save; a full disk may have room by now."""
        if self.unsaved:
            self._save()

    def _write(self, path: Path, entries: tuple[Entry, ...], effects: ModelEffects, left_out: tuple[str, ...]) -> None:
        shots = [entry_to_json(entry) for entry in entries if entry.path]
        document = {
            "schema": SCHEMA,
            "effects": keys_of(effects.collision),
            "drive_effects": keys_of(effects.drive),
            "tried": list(dict.fromkeys(keys_of(effects.tried))),
            "shots": shots,
            "left_out": list(left_out),
        }
        problem = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_json_atomic(path, document, sync=True)
        except (OSError, RecordingError) as error:
            problem = f"the session could not be saved: {error}"
        if problem != self.problem:
            self.save_problem, self.read_problem = problem, None
            self.revision += 1  # so that the window shows the new problem

    def switch_to(self, other: "Session") -> None:
        """Save this session, then take over the content and file of ``other``."""
        if self.path is not None:
            self._write(self.path, self.entries, self.effects, self.dismissed)
        self.unlock()
        self.path, self.entries, self.effects = other.path, other.entries, other.effects
        self.dismissed = other.dismissed
        self.unlock, self.read_problem, self.save_problem = other.unlock, other.read_problem, other.save_problem
        self._undo, self._redo, self._next = [], [], other._next
        self.revision += 1

    def move_to(self, path: Path, unlock: Callable[[], None]) -> None:
        """Save the session to another file from now on; the former file remains."""
        if self.path is not None:
            self._write(self.path, self.entries, self.effects, self.dismissed)
        self.unlock()
        self.path, self.unlock = path, unlock
        self._set(self.entries)

    @classmethod
    def reopen(cls, path: Path) -> "Session":
        """Return the session in ``path``, with its shots not read yet; an unreadable file is renamed."""
        session = cls(path)
        if not path.exists():
            return session
        try:
            document = CheckedTable(path, read_json(path))
            if (schema := document.text("schema", 100)) != SCHEMA:
                raise document.error_for("schema", f"{shown(schema)} is not {SCHEMA}")
            unknown: set[str] = set()
            session.entries = tuple(entry_from_json(item, unknown) for item in document.objects("shots") or ())
            session._next = max((entry.number for entry in session.entries), default=0)
            session.effects = model_effects(document)
            session.dismissed = document.names("left_out")[-MAX_DISMISSED:]
            unknown.update(document.unread())
            if unknown:
                session.read_problem = f"ignored, unknown to this version: {', '.join(sorted(unknown))}"
        except RecordingError as error:
            aside = path.with_name(path.name + ".unreadable")
            session.read_problem = f"the last session could not be read ({error}); the file was renamed to {aside.name}"
            try:
                os.replace(path, aside)
            except OSError:
                session.path = None
        return session
