"""Change the effects in the model and refit every shot.

The model may change again while a fit runs.  Each fit therefore records its effects and its shot, and is dropped if
the session's have changed.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from analysis.collision import Effect
from analysis.diagnosis import SavedModel
from analysis.fitted import can_be_fitted, fit_pending, fit_shot
from analysis.shot import Progress, Shot, Stop
from app.session.entry import Entry
from app.session.jobs import EventKind, Job, JobQueues, Notify
from app.session.model_in_use import load_model, model_words
from app.session.session import Session


@dataclass(frozen=True, slots=True)
class _PendingFit:
    """A running or queued fit, with its shot and its effects."""

    job: Job
    of: Shot
    effects: tuple[Effect, ...]


class ModelWork:
    """Keeps each shot fitted individually with the effects in the session's model; reports new fits to ``changed``."""

    def __init__(self, session: Session, work: JobQueues, notify: Notify, changed: Callable[[Entry], None]) -> None:
        self._session, self._work, self._notify, self._changed = session, work, notify, changed
        self._loaded: SavedModel | None = None
        self._pending: dict[int, _PendingFit] = {}  # by the entry's number

    @property
    def loaded_model(self) -> SavedModel | None:
        """Get the loaded model file; None if the session's model differs from it."""
        loaded = self._loaded
        return loaded if loaded is not None and loaded.effects == self._session.effects.of(loaded.base) else None

    def add(self, base: str, effects: Sequence[Effect]) -> None:
        """Add effects to the model of shots with this base."""
        now = self._session.effects.of(base)
        self._use(base, (*now, *(effect for effect in effects if effect not in now)))

    def add_tried(self, base: str, effect: Effect) -> None:
        """Add an effect that no diagnosis found, marked as tried."""
        if effect not in self._session.effects.of(base):
            self._use(base, (*self._session.effects.of(base), effect), tried=(effect,))

    def remove(self, base: str, effect: Effect) -> None:
        self._use(base, tuple(one for one in self._session.effects.of(base) if one != effect))

    def load(self, path: Path) -> None:
        """Queue the reading of a model file; its effects then replace those in the model."""
        self._work.short_jobs.submit("model file", lambda _, __: load_model(path), "model", partial(self.take, path))

    def take(self, path: Path, model: SavedModel) -> None:
        """Use the model read from a file."""
        self._loaded = model
        self._use(model.base, model.effects, model.tried)
        self._notify(EventKind.MODEL, f"Model {model_words(model)}, loaded from {path}")

    def _use(self, base: str, effects: tuple[Effect, ...], tried: Sequence[Effect] = ()) -> None:
        """Set the effects in the model and fit each shot individually, as ``--model FILE`` and a reopened session do.

        The joint fit of a diagnosis is its evidence and is saved in model files, but it is not used as a shot's fit.
        """
        self._session.set_effects(self._session.effects.with_effects(base, effects, tried))
        self.refit_outdated()

    # refits after a change of the model -------------------------------------------------------------------------

    def needs_refit(self, entry: Entry) -> bool:
        """Return whether an entry was fitted with other effects than those now in the model."""
        shot = entry.shot
        return shot is not None and can_be_fitted(shot) and shot.settings.effects != self._effects_for(shot)

    def refit_outdated(self, also: Iterable[Entry] = ()) -> None:
        """Queue the fit of every entry that is behind the model, and cancel outdated fits.

        Entries in ``also`` are fitted too if they still await their first fit, which may have been stopped.
        """
        awaiting = {entry.number for entry in also if entry.shot is not None and fit_pending(entry.shot)}
        shots = {entry.number: entry.shot for entry in self._session.entries if entry.shot is not None}
        for number, wanted in list(self._pending.items()):
            shot = shots.get(number)
            if shot is None or not _same_motion(shot, wanted.of) or wanted.effects != self._effects_for(shot):
                wanted.job.cancel()
                del self._pending[number]
        for entry in self._session.entries:
            if entry.number not in self._pending and (self.needs_refit(entry) or entry.number in awaiting):
                self._submit(entry)

    def _take_fit(self, number: int, of: Shot, effects: tuple[Effect, ...], fitted: Shot) -> None:
        """Store an entry's new fit, made from the shot ``of`` with these effects, unless it is outdated."""
        wanted = self._pending.get(number)
        if wanted is not None and wanted.of is of and wanted.effects == effects:
            del self._pending[number]
        entry = self._session.entry(number)
        if entry is None or entry.shot is None or not _same_motion(entry.shot, of):
            return
        if effects == self._effects_for(entry.shot):
            self._changed(self._session.fill(number, fitted))

    def forget(self) -> None:
        """Drop the pending fits and the model file of a session that is closed."""
        self._pending.clear()
        self._loaded = None

    def _effects_for(self, shot: Shot) -> tuple[Effect, ...]:
        return self._session.effects.of(shot.settings.model)

    def _submit(self, entry: Entry) -> None:
        number, shot = entry.number, entry.shot
        assert shot is not None
        effects = self._effects_for(shot)
        fitting, take = partial(refit_shot, shot, effects), partial(self._take_fit, number, shot, effects)
        job = self._work.submit_long(f"refit of {entry.name} with the changed model", fitting, "refit", take)
        self._pending[number] = _PendingFit(job, shot, effects)


def refit_shot(shot: Shot, effects: tuple[Effect, ...], *, progress: Progress, cancelled: Stop) -> Shot:
    """Return the shot refitted with these effects."""
    progress(f"fitting {shot.name}", 0.0)
    return fit_shot(shot, effects, cancelled)


def _same_motion(shot: Shot, of: Shot) -> bool:
    """Return whether two states of a shot have the same motion; path, note and fit may differ."""
    return shot.motion is of.motion
