"""The effects in the model: put in, tried, taken out, read from a file; every shot is then fitted again.

Fits take longer than a person needs to change the model once more.  Each result therefore says which effects and which
shot it was made with, and is dropped where that is no longer what the session holds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from analysis.diagnosis.model_file import SavedModel
from analysis.fitted.fitted_shot import awaits_fit, can_be_fitted
from analysis.shot.shot import Shot
from app.session.event import Event, Kind, Loaded, Refitted
from app.session.jobs import Asked, Job, Report, Work
from app.session.model_in_use import load_model, model_words
from app.session.session import Entry, Session
from app.session.shot_work import refit_shot


@dataclass(frozen=True, slots=True)
class _Wanted:
    """One fit that is under way: of which shot, with which effects."""

    job: Job
    of: Shot
    effects: tuple[str, ...]


class ModelWork:
    """One rule for every shot: it is fitted for itself, with the effects that the session's model holds."""

    def __init__(self, session: Session, work: Work) -> None:
        self._session, self._work = session, work
        self._loaded: SavedModel | None = None
        self._under_way: dict[int, _Wanted] = {}  # by the entry's number

    @property
    def known(self) -> SavedModel | None:
        """Get the model file in use; None once the model is another, until an undo brings it back."""
        loaded = self._loaded
        return loaded if loaded is not None and loaded.effects == self.effects_of(loaded.base) else None

    def effects_of(self, base: str) -> tuple[str, ...]:
        """Return the effects now in the model of shots with this base."""
        return self._session.effects.of(base)

    def add(self, base: str, names: Sequence[str]) -> None:
        """Add effects to the model of shots with this base, each of which is fitted again."""
        now = self.effects_of(base)
        self._use(base, (*now, *(name for name in names if name not in now)))

    def try_out(self, base: str, name: str) -> None:
        """Add an effect that no diagnosis named; it stays marked so."""
        if name not in self.effects_of(base):
            self._use(base, (*self.effects_of(base), name), tried=(name,))

    def remove(self, base: str, name: str) -> None:
        """Take an effect out again."""
        self._use(base, tuple(effect for effect in self.effects_of(base) if effect != name))

    def load(self, path: Path) -> None:
        """Queue the reading of a model file; its effects then are the model's, and every shot is fitted again."""
        self._work.errands.submit("model file", lambda _, __: Loaded(load_model(path), path), "model")

    def take(self, result: Loaded) -> Event:
        """Use a model file that was read; return what is to be said."""
        self._loaded = result.model
        self._use(result.model.base, result.model.effects, result.model.tried)
        return Event(Kind.MODEL, f"Model {model_words(result.model)}, taken from {result.path}")

    def _use(self, base: str, effects: tuple[str, ...], tried: Sequence[str] = ()) -> None:
        """Fit every shot for itself with the model: so do ``--model FILE`` and a session that is opened again.

        The joint fit of a diagnosis is its evidence, and what a model file keeps; it is no shot's own.
        """
        self._session.set_effects(self._session.effects.with_effects(base, effects).trying(tried))
        self.catch_up()

    # fits that follow the model ---------------------------------------------------------------------------------

    def is_behind(self, entry: Entry) -> bool:
        """Return whether the fit of an entry was made with other effects than the model now holds."""
        shot = entry.shot
        return shot is not None and can_be_fitted(shot) and shot.settings.effects != self._wanted_of(shot)

    def catch_up(self, also: Iterable[Entry] = ()) -> None:
        """Queue the fit of every entry that is behind the model, and give up those that are no longer wanted.

        ``also``: entries that await a fit which nobody else makes.
        """
        awaiting = {entry.number for entry in also if entry.shot is not None and awaits_fit(entry.shot)}
        shots = {entry.number: entry.shot for entry in self._session.entries if entry.shot is not None}
        for number, wanted in list(self._under_way.items()):
            shot = shots.get(number)
            if shot is None or not _same(shot, wanted.of) or wanted.effects != self._wanted_of(shot):
                wanted.job.cancel()
                del self._under_way[number]
        for entry in self._session.entries:
            if entry.number not in self._under_way and (self.is_behind(entry) or entry.number in awaiting):
                self._submit(entry)

    def take_fit(self, result: Refitted) -> Shot | None:
        """Give an entry the fit that was made for it; return its shot, None where the fit is out of date."""
        wanted = self._under_way.get(result.number)
        if wanted is not None and wanted.of is result.of and wanted.effects == result.effects:
            del self._under_way[result.number]
        entry = self._session.entry(result.number)
        if entry is None or entry.shot is None or not _same(entry.shot, result.of):
            return None
        if result.effects != self._wanted_of(entry.shot):
            return None
        shot = replace(result.shot, path=entry.path)  # it may have been saved elsewhere meanwhile
        self._session.fill(entry.number, shot)
        return shot

    def forget(self) -> None:
        """Leave the fits and the model file of a session that is closed."""
        self._under_way.clear()
        self._loaded = None

    def _wanted_of(self, shot: Shot) -> tuple[str, ...]:
        return self.effects_of(shot.settings.model)

    def _submit(self, entry: Entry) -> None:
        number, shot = entry.number, entry.shot
        assert shot is not None
        effects = self._wanted_of(shot)
        fitting = partial(refit_shot, shot, effects)

        def work(report: Report, cancelled: Asked) -> Refitted:
            report(f"fitting {entry.name}", 0.0)
            return Refitted(number, shot, effects, self._work.do(fitting, report, cancelled))

        job = self._work.submit(self._work.jobs, f"fit of {entry.name} with the new model", work, "refit")
        self._under_way[number] = _Wanted(job, shot, effects)


def _same(shot: Shot, of: Shot) -> bool:
    """Return whether two states of a shot are of the same analysis; path, note and fit may be others."""
    return shot.motion is of.motion
