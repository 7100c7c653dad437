"""The operator's own laws, typed or learned: save them and diagnose with them."""

from typing import Any

from PySide6.QtCore import QObject, Signal, Slot

from analysis.collision.laws.own import LawError, OwnLaw
from app.session.model_in_use import OwnLaws
from app.window.layout import Layout
from app.window.theme import Tone
from instrument.files.recording_error import RecordingError


class LawsPresenter(QObject):
    """Connects the folder of laws with the sheet for laws and the diagnosis."""

    said = Signal(str, Tone)
    diagnose_wanted = Signal()

    def __init__(self, laws: OwnLaws, panels: Layout, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._laws, self._panels = laws, panels
        panels.diagnosis.law_curve.keep_wanted.connect(self._keep)
        panels.diagnosis.law_wanted.connect(self.propose_law)
        panels.law.wanted.connect(self._take)

    @Slot()
    def propose_law(self) -> None:
        """Show or hide the sheet for laws."""
        self._panels.law.toggle()

    @Slot(object)
    def _keep(self, law: OwnLaw) -> None:
        self._panels.law.fill(law.written())
        self._panels.law.open()

    @Slot(dict)
    def _take(self, table: dict[str, Any]) -> None:
        try:
            law = self._laws.keep(table)
        except (LawError, RecordingError) as error:
            self._panels.law.say(str(error), Tone.BAD)
            return
        self._panels.law.hide()
        self.said.emit(f"The law {law.name!r} is saved in {self._laws.folder}; every diagnosis includes it", Tone.GOOD)
        self.diagnose_wanted.emit()
