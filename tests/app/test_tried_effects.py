"""An effect that no diagnosis named says so on the page of the diagnosis for as long as it is in the model."""

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from analysis.collision.effects import effects_named
from analysis.shot.shot import AnalysisSettings
from app.session.session import Session
from app.session.verdict_basis import Diagnosed
from app.session.workbench import Workbench
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.presenters.diagnosis import DiagnosisPresenter
from tests.app import synthetic

TRIED = "tried by the operator; not found by a diagnosis"


def test_an_effect_that_was_tried_is_marked_and_one_that_was_found_is_not(qtbot: QtBot) -> None:
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    workbench = Workbench(Session(), AnalysisSettings)
    try:
        shot = synthetic.shot()
        entry = workbench.session.add(shot)
        workbench.diagnoses.append(Diagnosed(synthetic.diagnosis(shot), (entry.number,)))
        presenter = DiagnosisPresenter(workbench, panels, panels)

        def words() -> str:
            presenter.refresh()
            QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)  # the rows before
            return " ".join(label.text() for label in panels.diagnosis.effects.findChildren(QLabel))

        effects, both = workbench.session.effects, effects_named(("viscous_drag", "tilt"))
        workbench.session.set_effects(effects.with_effects("paper", both[:1]))
        assert "iscous drag" in words() and TRIED not in words()
        workbench.session.set_effects(effects.with_effects("paper", both, both[1:]))
        assert words().count(TRIED) == 1
        workbench.session.set_effects(effects.with_effects("paper", both[:1]))
        assert "iscous drag" in words() and TRIED not in words()
    finally:
        workbench.close()
