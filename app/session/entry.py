"""An entry of a session, i.e. a shot with its note and verdict, and its JSON form in the session file."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any

from analysis.collision import Effect, without_nuisances
from analysis.shot import MAX_NOTE_LENGTH, PLOT_UNITS, SETUP_KEYS, AnalysisSettings, PlotNote, Shot
from app.session.verdict_basis import ModelEffects, VerdictBasis, known_effects
from instrument.files import CheckedTable, shown
from levimass import DRIVE


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of the session.  ``shot`` is None until the recording has been read."""

    number: int
    name: str
    path: str | None
    settings: AnalysisSettings
    shot: Shot | None = None
    note: str = ""
    plot_notes: tuple[PlotNote, ...] = ()  # oldest first
    verdict_of: VerdictBasis | None = None  # the verdict, with its model and shots
    copy_of: int | None = None  # number of the entry whose recording this entry analyses with other settings
    version: str = ""  # program version of a cached result, else ""

    @property
    def verdict(self) -> str:
        """Get the verdict in words; "" without one."""
        return self.verdict_of.words if self.verdict_of is not None else ""


_NOT_SAVED = ("shot", "version")  # fields that come from the recording or the cache, not from the session file


def entry_to_json(entry: Entry) -> dict[str, Any]:
    saved = {field.name: getattr(entry, field.name) for field in fields(entry) if field.name not in _NOT_SAVED}
    settings = entry.settings.written() | {"corrections": dict(entry.settings.corrections)}
    notes = [asdict(note) for note in entry.plot_notes]
    return saved | {
        "settings": settings,
        "verdict": entry.verdict,  # for a reader of the file; not read back
        "verdict_of": entry.verdict_of and _basis_to_json(entry.verdict_of),
        "plot_notes": notes,
    }


def entry_from_json(item: CheckedTable, unknown: set[str]) -> Entry:
    """Return an entry from the session file; names unknown to this version are added to ``unknown``."""

    def settings(item: CheckedTable) -> AnalysisSettings:
        chosen = item.required_object("settings")
        built = chosen.read_dataclass(AnalysisSettings, {"corrections": _corrections, "effects": _effects})
        unknown.update(chosen.unread())
        return built

    if item.get("path") is None:
        raise item.error_for("path", "missing")

    def plot_notes(item: CheckedTable) -> tuple[PlotNote, ...]:
        notes = []
        for listed in item.objects("plot_notes") or ():
            note = listed.read_dataclass(PlotNote, {"text": lambda note: note.text("text", MAX_NOTE_LENGTH) or ""})
            unknown.update(listed.unread())
            if note.plot in PLOT_UNITS:
                notes.append(note)
            else:
                unknown.add(f"a note on the plot {shown(note.plot)}")
        return tuple(notes)

    def verdict_of(item: CheckedTable) -> VerdictBasis | None:
        item.get("verdict")
        basis = item.object("verdict_of")
        if basis is None or basis.get("conclusion") is None:
            return None
        base = _base(item.required_object("settings"))
        keys = basis.names("effects"), basis.names("found")
        effects, found = (known_effects(given, base) for given in keys)
        built = basis.read_dataclass(VerdictBasis, {"effects": lambda _: effects, "found": lambda _: found})
        unknown.update(basis.unread())
        return built if (len(effects), len(found)) == tuple(map(len, keys)) else None

    own = {
        "settings": settings,
        "verdict_of": verdict_of,
        "shot": lambda _: None,
        "version": lambda _: "",
        "name": lambda item: item.text("name") or "",
        "plot_notes": plot_notes,
    }
    entry = item.read_dataclass(Entry, own)
    unknown.update(item.unread())
    return entry


def keys_of(effects: Iterable[Effect]) -> list[str]:
    return [effect.key for effect in effects]


def _basis_to_json(basis: VerdictBasis) -> dict[str, Any]:
    values = {field.name: getattr(basis, field.name) for field in fields(basis)}
    return values | {"effects": keys_of(basis.effects), "found": keys_of(basis.found)}


def model_effects(document: CheckedTable) -> ModelEffects:
    """Return the effects in the model; a "tried" mark applies to collision and drive effects with the same key."""
    collision = without_nuisances(known_effects(document.names("effects"), ""))
    drive = known_effects(document.names("drive_effects"), DRIVE)
    tried = document.names("tried")
    both = (*collision, *drive)
    return ModelEffects(collision, drive, tuple(effect for key in tried for effect in both if effect.key == key))


def _base(settings: CheckedTable) -> str:
    return settings.text("model") or AnalysisSettings().model


def _effects(settings: CheckedTable) -> tuple[Effect, ...]:
    return known_effects(settings.names("effects"), _base(settings))


def _corrections(chosen: CheckedTable) -> tuple[tuple[str, float | None], ...]:
    given = chosen.object("corrections")
    if given is None:
        return ()
    found = tuple((name, given.number(name, -1e3, 1e12)) for name in SETUP_KEYS if name in given.values)
    if unknown := given.unread():
        raise given.error_for(next(iter(unknown)), "nothing of the rig is called so")
    return found
