"""The effects in the model: put in, tried, taken out, read from a file; every shot is then fitted again."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from analysis.awaited_fit import awaits_fit
from analysis.diagnosis.model_file import SavedModel
from analysis.shot import Shot
from app.session.event import Event, Filled, Kind, Loaded
from app.session.jobs import Asked, Report
from app.session.model_in_use import load_model, model_words
from app.session.session import Entry, Session
from app.session.shot_work import refit_shot
from app.session.work import Work


class ModelWork:
    """One rule for every shot: it is fitted for itself.  ``known`` is the model file in use."""

    def __init__(self, session: Session, work: Work) -> None:
        self._session, self._work = session, work
        self.known: SavedModel | None = None

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
        self.known = result.model
        self._use(result.model.base, result.model.effects, result.model.tried)
        return Event(Kind.MODEL, f"Model {model_words(result.model)}, taken from {result.path}")

    def _use(self, base: str, effects: tuple[str, ...], tried: Sequence[str] = ()) -> None:
        """Fit every shot for itself with the model: so do ``--model FILE`` and a session that is opened again.

        The joint fit of a diagnosis is its evidence, and what a model file keeps; it is no shot's own.
        """
        self._session.set_effects(self._session.effects.with_effects(base, effects).trying(tried))
        self.refit(self._session.entries)

    def refit(self, entries: Sequence[Entry]) -> None:
        """Queue the fits of those entries that were fitted with other effects, or await a fit."""
        wanted = self._session.effects
        if not entries:
            return

        def work(report: Report, cancelled: Asked) -> Filled:
            done: list[tuple[int, Shot]] = []
            for place, entry in enumerate(entries):
                shot = entry.shot
                effects = () if shot is None else wanted.of(shot.settings.model)
                if shot is None or shot.motion is None:
                    continue
                if shot.settings.effects == effects and not awaits_fit(shot):
                    continue
                report(f"fitting {entry.name}", place / len(entries))
                done.append((entry.number, self._work.do(partial(refit_shot, shot, effects), report, cancelled)))
            return Filled(tuple(done))

        self._work.submit(self._work.jobs, "fit with the new model", work, "refit")
