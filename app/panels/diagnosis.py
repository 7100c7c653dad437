"""DIAGNOSIS: the verdict in words first, then the candidates, the residual before and after, and what was blind."""

import numpy as np
from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from analysis.diagnosis.result import Diagnosis, Errors, Verdict
from analysis.shot import Shot
from app.clear_layout import clear_layout
from app.panels.candidates import CandidateBars
from app.plots.shot_times import time_zero
from app.plots.time_stack import TimeStack
from app.theme import MARKS, Colours, Tone, sized, thin
from app.wording import effect_words, number, parameter_words

TONES = {Verdict.ADEQUATE: Tone.GOOD, Verdict.EFFECT_FOUND: Tone.WARNING, Verdict.UNEXPLAINED: Tone.BAD}
WORDS = {
    Verdict.ADEQUATE: "ADEQUATE",
    Verdict.EFFECT_FOUND: "EFFECT FOUND",
    Verdict.UNEXPLAINED: "UNEXPLAINED",
}


class DiagnosisPanel(QWidget):
    """What the model lacks, on which evidence, and the button that adds it."""

    diagnose_wanted = Signal()
    cancel_wanted = Signal()
    add_wanted = Signal(str)
    add_all_wanted = Signal(list)
    remove_wanted = Signal(str)

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._diagnosis: Diagnosis | None = None
        self._shots: list[Shot] = []
        self._model_effects: tuple[str, ...] = ()
        self._busy = False
        column = QVBoxLayout(self)
        column.setContentsMargins(10, 8, 10, 6)
        column.setSpacing(6)
        top = QHBoxLayout()
        self._verdict = QLabel(self)
        self._verdict.setFont(sized(self.font(), 1.5, bold=True))
        self._verdict.setMinimumWidth(self._verdict.fontMetrics().horizontalAdvance("✗ UNEXPLAINED  "))
        top.addWidget(self._verdict)
        top.addStretch(1)
        self.progress = QProgressBar(self)
        self.progress.setRange(0, 1000)
        self.progress.setAccessibleName("Progress of the diagnosis")
        self.progress.setMinimumWidth(260)
        policy = self.progress.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.progress.setSizePolicy(policy)
        self.cancel = QPushButton("Cancel", self)
        policy = self.cancel.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.cancel.setSizePolicy(policy)
        self.cancel.setToolTip("Stop the diagnosis; the one before is kept")
        self.diagnose = QPushButton("Diagnose selected shots", self)
        self.diagnose.setProperty("primary", True)
        self.diagnose.setToolTip("Find out what the model lacks, from all selected shots together  (D)")
        for widget in (self.progress, self.cancel, self.diagnose):
            top.addWidget(widget)
        column.addLayout(top)
        self._sentence = QLabel(self)
        self._sentence.setWordWrap(True)
        self._sentence.setFont(sized(self.font(), 1.2))
        self._sentence.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        column.addWidget(self._sentence)
        self._effects = QVBoxLayout()
        column.addLayout(self._effects)
        split = self._evidence = QSplitter(Qt.Orientation.Horizontal, self)
        left = QWidget(split)
        left_column = QVBoxLayout(left)
        left_column.setContentsMargins(0, 0, 0, 0)
        heading = QLabel("CANDIDATES, BEST FIRST", left)
        heading.setProperty("heading", True)
        left_column.addWidget(heading)
        self.bars = CandidateBars(colours, left)
        left_column.addWidget(self.bars, 1)
        right = QWidget(split)
        right_column = QVBoxLayout(right)
        right_column.setContentsMargins(6, 0, 0, 0)
        self._residual_heading = QLabel("RESIDUAL OF DISPLACEMENT", right)
        self._residual_heading.setProperty("heading", True)
        right_column.addWidget(self._residual_heading)
        self.stack = TimeStack("Residual before and after", colours, right)
        self._plots = [self.stack.add_plot("before", "nm", 1), self.stack.add_plot("after", "nm", 1)]
        self._bands = [plot.add_band(colours.band, colours.band_edge) for plot in self._plots]
        self._curves = [plot.add_curve("residual", thin(colours.residual)) for plot in self._plots]
        self.stack.label_time("time from first touch (ms)")
        self.stack.reset_wanted.connect(self.reset)
        right_column.addWidget(self.stack, 1)
        self._errors = QLabel(right)
        self._errors.setTextFormat(Qt.TextFormat.RichText)
        self._errors.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        right_column.addWidget(self._errors)
        split.setSizes([480, 500])
        split.setChildrenCollapsible(False)
        column.addWidget(split, 1)
        self._blind = QLabel(self)
        self._blind.setWordWrap(True)
        self._blind.setProperty("faint", True)
        self._blind.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        column.addWidget(self._blind)
        column.addStretch(0)
        self.diagnose.clicked.connect(self._diagnose)
        self.cancel.clicked.connect(self._cancel)
        self.show_progress(None, 0.0)
        self.dress(colours)
        self.show_diagnosis(None, [])

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Get the diagnosis shown."""
        return self._diagnosis

    @property
    def sentence(self) -> str:
        """Get the verdict sentence."""
        return self._sentence.text()

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.stack.dress(colours)
        self.bars.dress(colours)
        for curve in self._curves:
            curve.setPen(thin(colours.residual))
        self.show_diagnosis(self._diagnosis, self._shots, self._model_effects)

    def show_progress(self, what: str | None, fraction: float) -> None:
        """Show what is being done; None: nothing is."""
        busy = what is not None
        if busy != self._busy and self._diagnosis is None:
            self._busy = busy
            self.show_diagnosis(None, self._shots, self._model_effects)
        self._busy = busy
        self.progress.setVisible(busy)
        self.cancel.setVisible(busy)
        self.diagnose.setEnabled(not busy)
        if busy:
            self.progress.setValue(round(1000 * fraction))
            self.progress.setFormat(f"{what}  %p %")

    def show_problem(self, problem: str) -> None:
        """Show why there is no diagnosis."""
        self._verdict.setText(f"{MARKS[Tone.BAD]} NO DIAGNOSIS")
        self._verdict.setStyleSheet(f"color: {self._colours.signs[Tone.BAD]}")
        self._sentence.setText(problem)

    def show_diagnosis(
        self, diagnosis: Diagnosis | None, shots: list[Shot], model_effects: tuple[str, ...] = ()
    ) -> None:
        """Show a diagnosis over these shots; ``model_effects`` are the effects now in the model."""
        self._diagnosis, self._shots, self._model_effects = diagnosis, shots, model_effects
        clear_layout(self._effects)
        self._evidence.setVisible(diagnosis is not None)
        if diagnosis is None:
            self._verdict.setText(
                f"{MARKS[Tone.BUSY]} diagnosing" if self._busy else f"{MARKS[Tone.NEUTRAL]} not diagnosed"
            )
            self._verdict.setStyleSheet(f"color: {self._colours.signs[Tone.NEUTRAL]}")
            self._sentence.setText(
                "The selected shots are looked at together; you can go on working, and take shots, meanwhile."
                if self._busy
                else "Select one or several shots below and press Diagnose: the program looks at what the model leaves "
                "over, and says which effect the model lacks, if any. Shots at different speeds tell more."
            )
            self._blind.setText("")
            self._errors.setText("")
            self.bars.show_candidates((), set())
            for curve in self._curves:
                curve.clear_samples()
            for name in model_effects:
                self._effect_row(name, "", True)
            return
        tone = TONES[diagnosis.verdict]
        self._verdict.setText(f"{MARKS[tone]} {WORDS[diagnosis.verdict]}")
        self._verdict.setStyleSheet(f"color: {self._colours.signs[tone]}")
        self._sentence.setText(diagnosis.sentence)
        for effect in diagnosis.effects:
            parameters = ", ".join(parameter_words(key, value) for key, value in effect.parameters.items())
            rivals = ", ".join(effect_words(name) for name in effect.indistinguishable_from)
            words = parameters + (f"   cannot be told from: {rivals}" if rivals else "")
            self._effect_row(effect.name, words, effect.name in model_effects)
        missing = [effect.name for effect in diagnosis.effects if effect.name not in model_effects]
        if len(missing) > 1:
            self._add_all_row(missing)
        for name in model_effects:
            if name not in {effect.name for effect in diagnosis.effects}:
                self._effect_row(name, "", True)
        self.bars.show_candidates(diagnosis.candidates, {effect.name for effect in diagnosis.effects})
        self._show_errors(diagnosis)
        blind = list(diagnosis.blind_spots)
        lines = [f"Remainder: {diagnosis.remainder}"] if diagnosis.remainder else []
        lines += [f"What would separate these: {diagnosis.separating_shot}"] if diagnosis.separating_shot else []
        lines += [f"What this data could not show: {'; '.join(blind)}"] if blind else []
        self._blind.setText("\n".join(lines))
        self._show_residuals()

    def effect_button(self, name: str) -> QPushButton:
        """Return the button that adds an effect, or takes it out."""
        rows = [self._effects.itemAt(i).widget() for i in range(self._effects.count())]
        buttons = [button for row in rows if row is not None for button in row.findChildren(QPushButton)]
        return next(button for button in buttons if button.property("effect") == name)

    def _effect_row(self, name: str, words: str, in_model: bool) -> None:
        row = QWidget(self)
        line = QHBoxLayout(row)
        line.setContentsMargins(0, 0, 0, 0)
        label = QLabel(f"<b>{effect_words(name).capitalize()}</b>  {words}", row)
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        label.setWordWrap(True)
        button = QPushButton("Remove from the model" if in_model else "Add to the model", row)
        button.setProperty("effect", name)
        button.setToolTip(
            "Take the effect out again; overlays and fits follow"
            if in_model
            else "Use the effect from now on; overlays, fits and the next shots follow"
        )
        button.clicked.connect(self._remove if in_model else self._add)
        line.addWidget(label, 1)
        line.addWidget(button)
        self._effects.addWidget(row)

    def _add_all_row(self, names: list[str]) -> None:
        button = QPushButton("Add all to the model", self)
        button.setProperty("effects", names)
        button.setToolTip(
            "Use these effects together: the fits are those of the diagnosis, so that nothing is waited for"
        )
        button.clicked.connect(self._add_all)
        self._effects.addWidget(button, 0, Qt.AlignmentFlag.AlignRight)

    def _show_errors(self, diagnosis: Diagnosis) -> None:
        def cells(errors: Errors | None) -> str:
            if errors is None:
                return "<td align='right' style='padding: 0 6px'>–</td>" * 4
            values = (
                f"{number(1e9 * errors.displacement_rms_m, 3)} nm",
                f"{number(1e6 * errors.velocity_rms_m_per_s, 3)} µm/s",
                f"{number(1e3 * errors.force_rms_n, 3)} mN",
                number(errors.reduced_chi2, 4),
            )
            return "".join(f"<td align='right' style='padding: 0 6px'>{value}</td>" for value in values)

        heads = "".join(
            f"<td align='right' style='padding: 0 6px'><b>{head}</b></td>"
            for head in ("displacement", "velocity", "force", "χ²/ν")
        )
        rows = (
            ("before", diagnosis.error_before),
            ("after", diagnosis.error_after),
            ("held out, before", diagnosis.error_held_out_before),
            ("held out, after", diagnosis.error_held_out_after),
        )
        body = "".join(f"<tr><td>{name}</td>{cells(errors)}</tr>" for name, errors in rows)
        self._errors.setText(f"<table cellspacing='0'><tr><td>rms</td>{heads}</tr>{body}</table>")

    def _show_residuals(self) -> None:
        diagnosis = self._diagnosis
        shown = next((i for i, shot in enumerate(self._shots) if shot.motion is not None), None)
        if diagnosis is None or shown is None:
            return
        shot = self._shots[shown]
        motion = shot.motion
        assert motion is not None
        zero, words = time_zero(shot)
        self.stack.label_time(words)
        self._residual_heading.setText(f"RESIDUAL OF DISPLACEMENT, {shot.name} (band: noise, ±2 σ)")
        start, step = 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz
        for fit, curve, band in zip(
            (diagnosis.fit_before, diagnosis.fit_after), self._curves, self._bands, strict=True
        ):
            if shown < len(fit.shots):
                curve.show_samples(start, step, 1e9 * np.asarray(fit.shots[shown].residual_m))
                band.show_band(start, step, 2e9 * motion.displacement_std_m)
        self.reset()

    @Slot()
    def reset(self) -> None:
        """Show the whole shot."""
        samples = self._curves[0].samples
        if len(samples):
            start, step = self._curves[0].grid
            self.stack.zoom(start, start + step * len(samples))

    @Slot()
    def _diagnose(self) -> None:
        self.diagnose_wanted.emit()

    @Slot()
    def _cancel(self) -> None:
        self.cancel_wanted.emit()

    @Slot()
    def _add(self) -> None:
        self.add_wanted.emit(str(self.sender().property("effect")))

    @Slot()
    def _add_all(self) -> None:
        self.add_all_wanted.emit(self.sender().property("effects"))

    @Slot()
    def _remove(self) -> None:
        self.remove_wanted.emit(str(self.sender().property("effect")))
