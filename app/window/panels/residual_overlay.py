"""Residuals of all shots before and after a diagnosis, overlaid with the hovered candidate's contribution.

A button shows the residuals with the best and the second-best candidate side by side.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QHBoxLayout, QWidget

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis
from analysis.shot import Floats, Shot
from analysis.uncertainty import diagnosed_band
from app.report import time_zero
from app.session import CandidateResidual, by_evidence
from app.window.panels.effects import CandidateBars
from app.window.plots.residual_grid import MOST, Cell, Overlay, ResidualGrid
from app.window.theme import Colours, Themed, Tone
from app.window.widgets import push_button, text_label, vertical
from app.words import joined, number, short_name, tag

MOST_COMPARED_SHOTS = 4  # most shots in the comparison of two candidates


def explained(left_m: Floats, curve_m: Floats) -> Overlay:
    """Return the overlay of a residual (n,) from a curve (k,) of its means over k equal parts of the record."""
    middles = (np.arange(curve_m.size) + 0.5) * (left_m.size / max(1, curve_m.size)) - 0.5
    signature_m = np.interp(np.arange(left_m.size), middles, curve_m)
    return Overlay(signature_m, left_m - signature_m)


class ResidualOverlay(Themed, QWidget):
    """The grid of residuals, its heading, and the button that compares the best two candidates."""

    pointed = Signal(object)  # effect of the hovered candidate

    def __init__(self, bars: CandidateBars, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._diagnosis: Diagnosis | None = None
        self._shots: list[Shot] = []
        self._accepted = False
        self._found: Mapping[Effect, CandidateResidual] = {}
        self._effect: Effect | None = None
        column = vertical(self, (6, 0, 0, 0))
        top = QHBoxLayout()
        self._heading = text_label("", self, heading=True, wrap=True)
        hover = "Residuals with the best and with the second-best candidate, side by side"
        self.neighbour = push_button("Compare best two", hover, self, checkable=True)
        self.neighbour.toggled.connect(self._draw)
        top.addWidget(self._heading, 1)
        top.addWidget(self.neighbour)
        column.addLayout(top)
        self.grid = ResidualGrid(self)
        column.addWidget(self.grid, 1)
        self.said = text_label("", self, wrap=True)
        self.said.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        column.addWidget(self.said)
        bars.pointed.connect(self.point_at)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._draw()

    def show_diagnosis(self, diagnosis: Diagnosis | None, shots: list[Shot], accepted: bool) -> None:
        """Show the residuals of all shots; ``accepted``: the effects found are in the model, so show only "after"."""
        if diagnosis is not self._diagnosis:
            self._found, self._effect = {}, None
            self.neighbour.setChecked(False)
        self._diagnosis, self._shots, self._accepted = diagnosis, shots, accepted
        self._draw()

    def show_found(self, found: Mapping[Effect, CandidateResidual]) -> None:
        """Set the residuals of the candidates fitted so far."""
        self._found = dict(found)
        self._draw()

    @Slot(object)
    def point_at(self, effect: Effect | None) -> None:
        """Overlay what a candidate would explain; None removes the overlay."""
        self._effect = effect
        if effect is not None:
            self.pointed.emit(effect)
        self._draw_overlay()

    def _pair(self) -> tuple[CandidateResidual, CandidateResidual] | None:
        """Return the residuals of the two best fitted candidates, or None until two are fitted."""
        if self._diagnosis is None:
            return None
        ranked = [self._found.get(candidate.effect) for candidate in by_evidence(self._diagnosis.candidates)]
        there = [remainder for remainder in ranked if remainder is not None and remainder.left_m is not None]
        return (there[0], there[1]) if len(there) > 1 else None

    @Slot()
    def _draw(self) -> None:
        found, pair = self._diagnosis, self._pair()
        self.neighbour.setVisible(found is not None)
        self.neighbour.setEnabled(pair is not None)
        if found is None:
            self.grid.show_cells(())
            self._heading.setText("")
            self.said.setText("")
            return
        if pair is not None and self.neighbour.isChecked():
            self._draw_pair(*pair)
            return
        self.grid.show_cells(self._cells(found))
        count = len(self.grid.cells)
        more = f" (first {MOST} of {len(self._shots)})" if len(self._shots) > count else ""
        which = "AFTER" if self._accepted else "BEFORE (grey) AND AFTER (blue)"
        self._heading.setText(f"RESIDUAL OF DISPLACEMENT {which}, {count} SHOT{'S' if count != 1 else ''}{more}")
        self._draw_overlay()

    def _cells(self, found: Diagnosis) -> list[Cell]:
        cells = []
        before, after = found.fit_before.shots, found.fit_after.shots
        for place, shot in enumerate(shot for shot in self._shots if shot.motion is not None):
            if place >= min(len(before), len(after)) or shot.motion is None:
                break
            noise_m, _ = diagnosed_band(found, shot)
            left = None if self._accepted else np.asarray(before[place].residual_m)
            time_ms = 1e3 * (shot.motion.time_s - time_zero(shot)[0])
            title = short_name(shot.name)
            cells.append(Cell(title, time_ms, left, np.asarray(after[place].residual_m), noise_m))
        return cells

    def _draw_pair(self, first: CandidateResidual, second: CandidateResidual) -> None:
        assert self._diagnosis is not None
        cells = []
        for place, cell in enumerate(self._cells(self._diagnosis)[:MOST_COMPARED_SHOTS]):
            for remainder in (first, second):
                left = remainder.left_m[place] if remainder.left_m is not None else cell.after_m
                title = f"{cell.title}: {remainder.effect.words}"
                cells.append(Cell(title, cell.time_ms, None, left, cell.noise_m))
        self.grid.show_cells(cells)
        names = [remainder.effect.words for remainder in (first, second)]
        self._heading.setText("RESIDUALS WITH THE BEST AND WITH THE SECOND-BEST CANDIDATE")
        chi2 = [number(remainder.reduced_chi2, 3) for remainder in (first, second)]
        self.said.setText(f"Joint χ²/ν {chi2[0]} with {names[0]}, {chi2[1]} with {names[1]}")

    def _explained(self, found: Diagnosis, effect: Effect) -> tuple[Sequence[Overlay | None], str]:
        """Return the overlay of each shot for a candidate, and the sentence below the grid.

        The overlay comes from the candidate's joint fit or, until that has finished, from the diagnosis's own curve.
        """
        remainder = self._found.get(effect)
        candidate = next((one for one in found.candidates if one.effect == effect), None)
        lefts = [np.asarray(shot.residual_m) for shot in found.fit_before.shots]
        words = effect.words
        if remainder is not None and remainder.left_m is not None:
            pairs = zip(lefts, remainder.left_m, strict=False)
            overlays = [Overlay(left - remains, remains) for left, remains in pairs if left.shape == remains.shape]
            how = f"χ²/ν {number(remainder.reduced_chi2, 3)}"
        elif candidate is not None and candidate.explains_m is not None:
            overlays = [explained(*pair) for pair in zip(lefts, candidate.explains_m, strict=False)]
            how = "first order" if candidate.delta_bic is None else "as fitted in the diagnosis"
        elif remainder is not None:
            return (), f"{words}: its fit did not converge"
        else:
            return (), f"{words}: not fitted in full yet"
        colour, rest = self.colours.simulated, self.colours.signs[Tone.GOOD]
        lines = [tag("span", "━", style=f"color:{shown}") for shown in (colour, rest)]
        return overlays, joined(tag("b", words), ": ", lines[0], " explained, ", lines[1], f" remaining; {how}")

    def _draw_overlay(self) -> None:
        found = self._diagnosis
        if found is None or (self.neighbour.isChecked() and self._pair() is not None):
            return
        words = "Point at a candidate to see what it explains and what remains."
        overlays: Sequence[Overlay | None] = ()
        if self._effect is not None:
            overlays, words = self._explained(found, self._effect)
        self.grid.overlay(overlays)
        self.said.setText(words)
