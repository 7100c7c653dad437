"""DIAGNOSIS page: verdict, effects found, candidates, residuals before and after, detection limits."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QProgressBar, QSplitter, QVBoxLayout, QWidget

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, Verdict, in_words
from analysis.shot import Shot
from app.window.controls.theme import Tone
from app.window.controls.widgets import (
    FoldButton,
    add_row,
    added,
    heading_label,
    keep_place,
    push_button,
    scrolled,
    show_toned,
    text_label,
    vertical,
)
from app.window.panels.effects import CandidateBars, EffectRows
from app.window.panels.law import LawCurve
from app.window.panels.next_steps import NextShotCard, NextSteps
from app.window.panels.residuals import ResidualOverlay, Residuals
from app.window.plots.plot_view import PlotView, in_front
from app.words import OUTDATED, VERDICTS, cached_words, listed, localised_text, short_name, tag

MAX_NAMED = 5  # most shots named
MIN_SIDE_BY_SIDE_WIDTH = 78  # least width, in letters M, for candidates and residuals side by side
NEAR_ONE = 1.5  # chi^2/nu below which an unexplained residual looks like noise


class DiagnosisPanel(QWidget):
    """The DIAGNOSIS page."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._diagnosis: Diagnosis | None = None
        self._shots: list[Shot] = []
        self._model_effects: tuple[Effect, ...] = ()
        self.tried: tuple[Effect, ...] = ()  # effects in the model that no diagnosis found
        self._version = ""  # program version of a cached diagnosis, else ""
        self._holds = True
        self._busy = False
        self._running = ""  # name of the running diagnosis
        inner = scrolled("Diagnosis", self)
        inner.setProperty("panel", True)
        column = vertical(inner, (10, 4, 10, 4), 4)
        self._add_head(column)
        self.effects = EffectRows(self)
        self.next_shot = NextShotCard(self)
        self.next_steps = NextSteps(self)
        for widget in (self.effects, self.next_shot, self.next_steps):
            column.addWidget(widget)
        self.law_curve = added(column, LawCurve(self), 1)
        self._add_evidence(column)
        self._add_details(column)
        column.addStretch(0)
        self.show_progress(None, 0.0)
        self.show_diagnosis(None, [])

    def _add_head(self, column: QVBoxLayout) -> None:
        """Add verdict, progress bar, buttons, names of the diagnosed shots, and the summary sentence."""
        self._verdict = text_label("", self, bold=True, size=1.5)
        self._verdict.setMinimumWidth(self._verdict.fontMetrics().horizontalAdvance("✗ UNEXPLAINED  "))
        self.progress = QProgressBar(self)
        self.progress.setRange(0, 1000)
        self.progress.setAccessibleName("Progress of the diagnosis")
        self.progress.setMinimumWidth(120)
        self.cancel = push_button("Cancel", "Stop the diagnosis; the previous one is kept", self)
        keep_place(self.progress)
        keep_place(self.cancel)
        hover = "Find out what the model lacks, from all selected shots together"
        self.diagnose = push_button("Diagnose", hover, self, command="diagnose", primary=True)
        add_row(column, self._verdict, self.progress, self.cancel, self.diagnose)
        self._of = added(column, text_label("", self, faint=True, wrap=True))  # names of the shots
        self.sentence = added(column, text_label("", self, selectable=True, wrap=True, size=1.2))

    def _add_evidence(self, column: QVBoxLayout) -> None:
        """Add the candidates and the residuals of all shots."""
        split = self._evidence = QSplitter(Qt.Orientation.Horizontal, self)
        left = QWidget(split)
        left_column = vertical(left)
        left_column.addWidget(heading_label("CANDIDATES, BY EVIDENCE", left, wrap=True))
        self.bars = added(left_column, CandidateBars(left), 1)
        self.why = ResidualOverlay(self.bars, split)
        split.setSizes([380, 600])
        split.setChildrenCollapsible(False)
        column.addWidget(split, 1)
        self._arrange_evidence()

    def _add_details(self, column: QVBoxLayout) -> None:
        """Add the foldable details: errors, one shot's residuals, detection limits."""
        hover = "The table of errors, the first shot's residual with cursors, and the detection limits"
        self.fold = added(column, FoldButton("Errors, one shot in detail, detection limits", hover, self))
        self.fold.toggled.connect(self._folded)
        self.residuals = added(column, Residuals(self), 1)
        self._blind = added(column, text_label("", self, faint=True, selectable=True, wrap=True))

    @Slot(bool)
    def _folded(self, shown: bool) -> None:
        """Show or hide the details; a drive's details are always shown."""
        there = self._diagnosis is not None
        self.fold.setVisible(there and not self._driven)
        self.residuals.setVisible(there and (shown or self._driven))
        self._blind.setVisible(there and (shown or self._driven) and bool(self._blind.text()))

    @property
    def _driven(self) -> bool:
        return self._diagnosis is not None and self._diagnosis.drive is not None

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange_evidence()

    def _arrange_evidence(self) -> None:
        """Place the residuals to the right of the candidates, or below them on a narrow page."""
        beside = self.width() >= MIN_SIDE_BY_SIDE_WIDTH * self.fontMetrics().horizontalAdvance("M")
        self._evidence.setOrientation(Qt.Orientation.Horizontal if beside else Qt.Orientation.Vertical)
        self._evidence.setMinimumHeight((16 if beside else 30) * self.fontMetrics().lineSpacing())

    def show_progress(self, what: str | None, fraction: float, of: str = "") -> None:
        """Show the step of the running diagnosis ``of``; None: no diagnosis is running."""
        busy = what is not None
        if busy != self._busy and self._diagnosis is None:
            self._busy = busy
            self.show_diagnosis(None, self._shots, self._model_effects)
        self._busy = busy
        self.progress.setVisible(busy)
        self.cancel.setVisible(busy)
        self.diagnose.setEnabled(not busy)
        if what is not None:
            self.progress.setValue(round(1000 * fraction))
            room = self.progress.width() - self.fontMetrics().horizontalAdvance("M 100 %")
            words = self.fontMetrics().elidedText(what, Qt.TextElideMode.ElideRight, room)
            self.progress.setFormat(f"{words}  %p %")
            self.progress.setToolTip(what)
        if of != self._running:
            self._running = of
            self._name_shots()

    def show_problem(self, problem: str) -> None:
        show_toned(self._verdict, "NO DIAGNOSIS", Tone.BAD)
        self.sentence.setText(problem)

    def show_diagnosis(
        self,
        diagnosis: Diagnosis | None,
        shots: list[Shot],
        model_effects: tuple[Effect, ...] = (),
        version: str = "",
        holds: bool = True,
    ) -> None:
        """Show a diagnosis of these shots; ``model_effects`` are the effects now in the model.

        ``version`` is the program version of a cached result; ``holds``: model and shots are unchanged since.
        """
        self._version, self._holds = version, holds
        self._diagnosis, self._shots, self._model_effects = diagnosis, shots, model_effects
        self._name_shots()
        self.effects.show_effects(diagnosis.findings if diagnosis is not None else (), model_effects, self.tried)
        self.next_steps.show_diagnosis(diagnosis, model_effects)
        self._evidence.setVisible(diagnosis is not None)
        self.why.setVisible(not self._driven)
        self.law_curve.show_laws(diagnosis.laws if diagnosis is not None else (), shots)
        if diagnosis is None:
            self._show_none()
        else:
            self._show_found(diagnosis)
        self._folded(self.fold.isChecked())

    def _show_none(self) -> None:
        """Show that the shots are not diagnosed yet."""
        show_toned(self._verdict, *(("diagnosing", Tone.BUSY) if self._busy else ("not diagnosed", Tone.NEUTRAL)))
        self.sentence.setText(
            "The selected shots are analysed together; you can keep working and take shots meanwhile."
            if self._busy
            else "Select one or several shots below and press Diagnose: the program examines the "
            "residual and names the missing effect, if any. Shots at different speeds give more information."
        )
        self._blind.setText("")
        self.bars.show_candidates((), set())
        self.why.show_diagnosis(None, [], False)
        self.residuals.clear()

    def _show_found(self, diagnosis: Diagnosis) -> None:
        """Show verdict, evidence and details of the diagnosis."""
        self._show_verdict(diagnosis.verdict)
        said = in_words(diagnosis)
        self.sentence.setText(localised_text(said.sentence))
        self.bars.show_candidates(diagnosis.candidates, {found.effect for found in diagnosis.effects})
        lines = [f"Remaining residual: {said.remainder}"] if said.remainder else []
        if diagnosis.verdict is Verdict.UNEXPLAINED and diagnosis.error_after.reduced_chi2 < NEAR_ONE:
            lines.append(
                "χ²/ν is relative to noise estimated from this residual, unexplained part included, hence near 1"
            )
        separating = said.separating_shot and not self.next_steps.isVisibleTo(self)
        lines += [f"Shot that would distinguish these: {said.separating_shot}"] if separating else []
        lines += [f"Detection limits: {'; '.join(said.blind_spots)}"] if said.blind_spots else []
        self._blind.setText(localised_text("\n".join(lines)))
        self.residuals.show_diagnosis(diagnosis, self._shots)
        self.why.show_diagnosis(diagnosis, [] if self._driven else self._shots, self._accepted)

    def _show_verdict(self, verdict: Verdict) -> None:
        """Show the verdict, whether its effects are in the model, and whether it is valid."""
        tone, words = Tone(VERDICTS[verdict].tone), VERDICTS[verdict].brief.upper()
        if self._accepted and verdict in (Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED):
            tone, words = Tone.GOOD, f"{words}, IN THE MODEL"
        elif self._accepted:
            words = f"{words}, EFFECTS ALREADY IN THE MODEL"
        if not self._holds:
            tone, words = Tone.NEUTRAL, tag("s", words)
        show_toned(self._verdict, words, tone)

    @property
    def _accepted(self) -> bool:
        """Get whether all effects found are in the model."""
        found = self._diagnosis.findings if self._diagnosis is not None else ()
        return bool(found) and all(one.effect in self._model_effects for one in found)

    def _name_shots(self) -> None:
        """Show the names of the diagnosed shots and of the running diagnosis."""
        shots = self._shots
        names = listed([short_name(shot.name) for shot in shots], MAX_NAMED)
        kept = f"   ({cached_words(self._version)})" if self._version else ""
        old = "" if self._holds else f"   {OUTDATED}"
        about = f"of {names}{kept}{old}" if self._diagnosis is not None and shots else ""
        running = f"running: {self._running}" if self._running else ""
        self._of.setText("   ".join(part for part in (about, running) if part))

    def plot_in_front(self) -> PlotView:
        """Return the learned law's plot if it has the focus, else the residuals."""
        if self._diagnosis is not None and not self.residuals.isVisible():
            self.fold.setChecked(True)  # a key for plots was pressed, so a plot must be visible
        return in_front((self.residuals.stack_in_view, self.law_curve.plot))
