"""MODEL panel: the model, its fit to the selected shot, and the verdict of the last diagnosis."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QFrame, QWidget

from analysis.collision import Effect
from analysis.fitted import fit_pending
from analysis.shot import Fit, Shot, split_unit
from app.window.controls.theme import MARKS, Tone
from app.window.controls.widgets import add_row, heading_label, push_button, set_tone, show_toned, text_label, vertical
from app.words import (
    OUTDATED,
    Markup,
    base_words,
    model_in_words,
    number,
    or_dash,
    tag,
    with_prefix,
)

LACKING_CHI2 = 1.5  # chi^2/nu above which the misfit exceeds the noise


def _matrix(fit: Fit) -> Markup:
    """Return the correlations as a triangular table; columns have the same numbers as the rows."""
    head = [tag("th", str(n), align="right") for n in range(1, len(fit.parameters))]
    rows = [tag("tr", tag("th"), tag("th"), head)]
    for index, name in enumerate(fit.parameters):
        cells = [tag("td", or_dash(r, ".2f"), align="right") for r in fit.correlations[index, :index]]
        rows.append(tag("tr", tag("td", str(index + 1)), tag("td", split_unit(name)[0]), cells))
    return tag("table", rows, cellspacing=4)


class ModelPanel(QFrame):
    """The MODEL panel: base model and effects, chi^2/nu of the fit, verdict, correlations."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (10, 2, 8, 4), 1)
        hover = "Find out what the model lacks, from all selected shots together"
        self.diagnose = push_button("Diagnose", hover, self, command="diagnose")
        hover = "Candidates, residual before and after"
        self.details = push_button("Evidence", hover, self, command="show_page:DIAGNOSIS")
        hover = "Correlations of the fitted parameters of this shot"
        self.correlated = push_button("Correlations", hover, self, checkable=True)
        self.correlated.toggled.connect(self._unfold)
        heading = heading_label("MODEL", self)
        add_row(column, heading, self.correlated, self.diagnose, self.details)
        labels = [text_label("", self, selectable=True, wrap=True) for _ in range(5)]
        self._model, self._fit, self.known, self.verdict, self.correlations = labels
        self._misfit = ""  # chi^2/nu of a fit whose misfit exceeds the noise, in words
        for label in labels:
            column.addWidget(label)
        self.verdict.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        self.verdict.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.correlations.setAccessibleName("Correlations of the fitted parameters")
        self.show_shot(None)
        self.show_verdict("", Tone.NEUTRAL)
        self.show_known("", Tone.NEUTRAL)

    def show_shot(self, shot: Shot | None, tried: tuple[Effect, ...] = ()) -> None:
        """Show the model fitted to a shot; ``tried`` are effects that no diagnosis found."""
        fit = shot.fit if shot is not None else None
        shown = fit is not None and fit.converged
        self.correlations.setText(_matrix(fit) if fit is not None and shown else "")
        self.correlated.setEnabled(shown)
        self.correlations.setVisible(shown and self.correlated.isChecked())
        self._misfit = ""
        if fit is None:
            how = "fit to follow" if shot is not None and fit_pending(shot) else "not fitted"
            base = shot.settings.model if shot is not None else ""
            self._model.setText("no shot selected" if shot is None else f"{base_words(base)}: {how}")
            self._fit.setText("")
            return
        self._model.setText(tag("b", model_in_words(fit.model, fit.effects, tried)))
        if not fit.converged:
            show_toned(self._fit, "the fit did not converge: its numbers are not shown", Tone.BAD)
            return
        lacking = fit.reduced_chi2 > LACKING_CHI2
        set_tone(self._fit, Tone.WARNING if lacking else None)
        chi2, noise = number(fit.reduced_chi2, 4), with_prefix(fit.noise_std_m, "m")
        words = f"χ²/ν of this shot's fit {chi2}, noise {noise} per sample"
        self._misfit = f"{MARKS[Tone.WARNING]} {words}\nmisfit exceeds noise" if lacking else ""
        self._fit.setText(self._misfit or words)
        self._fit.setToolTip(
            "Of this shot alone, against the noise that its own fit weighs. Near 1: the residual is noise. Far above: "
            "the model is incomplete.\nA diagnosis states the joint χ²/ν of all its shots, against its own noise."
        )

    def show_verdict(self, sentence: str, tone: Tone, advice: str = "") -> None:
        """Show the verdict on the shot, and what to do about a misfit of its fit; "" for nothing."""
        if self._misfit:
            self._fit.setText(": ".join(filter(None, (self._misfit, advice))))
        show_toned(self.verdict, sentence, tone)
        if not sentence:
            self.verdict.setText("not diagnosed yet")
        self.verdict.setToolTip(OUTDATED if isinstance(sentence, Markup) else "")

    def show_known(self, words: str, tone: Tone) -> None:
        """Show how well the shot agrees with the model file in use; "" hides the line."""
        self.known.setVisible(bool(words))
        show_toned(self.known, words, tone)

    @Slot(bool)
    def _unfold(self, unfolded: bool) -> None:
        self.correlations.setVisible(unfolded and self.correlated.isEnabled())
