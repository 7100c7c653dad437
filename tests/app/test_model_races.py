"""Whatever is asked for while shots are fitted, in whatever order: in the end every fit is of the session's model."""

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.model_file import SavedModel, saved
from analysis.shot.shot import AnalysisSettings
from app.session.session import Session
from app.session.workbench import Workbench
from tests.app import synthetic
from tests.app.stepped_work import SteppedWork

EFFECTS = st.sampled_from(effects_named(("viscous_drag", "quadratic_drag", "coulomb_friction")))
SAVED = st.sampled_from((effects_named(("viscous_drag",)), effects_named(("quadratic_drag", "tilt")), ()))


def model_file(effects: tuple[str, ...], base: str = "paper") -> SavedModel:
    """Return what a model file with these effects holds."""
    fit = synthetic.shot().fit
    assert fit is not None
    return saved(replace(fit, effects=effects, model=base), ["a", "b"], None, set())


class Races(RuleBasedStateMachine):
    """Random orders of what a person may ask for, with the fits under way ending whenever it is drawn."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory()
        self.gate = SteppedWork()
        self.bench = Workbench(Session(), AnalysisSettings, subprocess_worker=self.gate)  # type: ignore[arg-type]
        self.shots = 0
        for _ in range(2):
            self.captured()

    def teardown(self) -> None:
        self.bench.poll()
        while self.bench.jobs.open_jobs or self.bench.short_jobs.open_jobs:
            self.gate.step(self.bench, heeds=True)
            self.bench.poll()  # what ended may ask for more
        try:
            for entry in self.bench.session.entries:
                assert entry.shot is not None and entry.shot.fit is not None
                wanted = self.bench.session.effects.of("paper")
                assert entry.shot.fit.effects == wanted, f"{entry.name}: {entry.shot.fit.effects}, not {wanted}"
                assert entry.path == entry.shot.path
        finally:
            self.gate.close()
            self.bench.close()
            self._folder.cleanup()

    def _path(self) -> Path:
        self.shots += 1
        path = Path(self._folder.name) / f"shot-{self.shots}.csv"
        path.write_text("time_s,displacement_m\n")
        return path

    @rule()
    def captured(self) -> None:
        shot = synthetic.shot()
        assert shot.fit is not None
        effects = self.bench.session.effects.of("paper")
        fitted = replace(shot.fit, effects=effects)
        path = self._path()
        chosen = replace(shot.settings, effects=effects)
        self.bench.add_shot(replace(shot, name=path.stem, path=str(path), fit=fitted, settings=chosen))

    @rule(name=EFFECTS)
    def add(self, name: str) -> None:
        self.bench.model.add("paper", (name,))

    @rule(name=EFFECTS)
    def try_out(self, name: str) -> None:
        self.bench.model.add_tried("paper", name)

    @rule(name=EFFECTS)
    def take_out(self, name: str) -> None:
        self.bench.model.remove("paper", name)

    @rule()
    def undo(self) -> None:
        self.bench.undo()

    @rule()
    def redo(self) -> None:
        self.bench.redo()

    @rule(effects=SAVED)
    def open_model(self, effects: tuple[str, ...]) -> None:
        take = partial(self.bench.model.take, Path("model.toml"))
        self.bench._work.short_jobs.submit("model file", lambda _, __: model_file(effects), "model", take)
        self.gate.short_jobs_end(self.bench)  # when they are taken is drawn, not when a thread comes to them

    @rule()
    def open_recording(self) -> None:
        self.bench.open_paths([self._path()])

    @rule(data=st.data())
    def analyse_again(self, data: st.DataObject) -> None:
        if numbers := [entry.number for entry in self.bench.session.entries]:
            self.bench.reanalyse([data.draw(st.sampled_from(numbers))])

    @rule(data=st.data())
    def take_off_the_list(self, data: st.DataObject) -> None:
        if numbers := [entry.number for entry in self.bench.session.entries]:
            self.bench.session.remove([data.draw(st.sampled_from(numbers))])

    @rule()
    def look(self) -> None:
        self.bench.poll()

    @rule(heeds=st.booleans())
    def work_goes_on(self, heeds: bool) -> None:
        self.gate.step(self.bench, heeds=heeds)

    @invariant()
    def one_model_file_or_none(self) -> None:
        known = self.bench.model.loaded_model
        if known is not None:
            assert known.effects == self.bench.session.effects.of(known.base)


Races.TestCase.settings = settings(
    max_examples=60, stateful_step_count=25, deadline=None, suppress_health_check=list(HealthCheck)
)
TestRaces = Races.TestCase
