"""Next steps after a diagnosis: effects to try if a residual is unexplained, and the shot that decides."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QWidget

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, Verdict, in_words, remark_on
from analysis.planning import NextShot, PlannedStep, PlanningState, first_indistinguishable
from app.window.controls.widgets import (
    FlowLayout,
    added,
    clear_layout,
    heading_label,
    push_button,
    text_label,
    vertical,
)
from app.words import localised_text

MAX_TRIED = 3
OPEN = (Verdict.UNEXPLAINED, Verdict.PARTLY_EXPLAINED)
ANOTHER_SHOT = (
    "more shots at other speeds, half and twice as fast: effects that depend on speed, position or time "
    "differ there; "
    "and a repetition of one shot, to see whether the effect repeats"
)


class NextSteps(QWidget):
    """Buttons to try candidates or propose a law, and advice on the next shot; hidden if all is explained."""

    try_wanted = Signal(object)  # effect of a candidate that the diagnosis did not accept
    law_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (0, 0, 0, 0), 2)
        column.addWidget(heading_label("NEXT STEP", self))
        row = QWidget(self)
        self._row = FlowLayout(row)
        column.addWidget(row)
        self.shot = added(column, text_label("", self, wrap=True))
        self.hide()

    def show_diagnosis(self, diagnosis: Diagnosis | None, in_model: tuple[Effect, ...]) -> None:
        """Show the possible next steps after a diagnosis."""
        clear_layout(self._row)
        self.setVisible(diagnosis is not None and diagnosis.verdict in OPEN)
        if diagnosis is None or diagnosis.verdict not in OPEN:
            return
        named = {found.effect for found in diagnosis.effects} | set(in_model)
        left = [c for c in diagnosis.candidates if c.effect not in named and c.parameters]
        for candidate in sorted(left, key=lambda c: -abs(c.score))[:MAX_TRIED]:
            remark = f" ({said})" if (said := remark_on(candidate)) else ""
            hover = f"Add it to the model although it failed a test{remark}; it is marked as tried"
            words = f"Try {candidate.effect.words}"
            self._add(push_button(words, hover, self, self.try_wanted, candidate.effect))
        hover = "Type a law of your own; it is fitted and judged like the others"
        self._add(push_button("Propose a law …", hover, self, self.law_wanted))
        self.shot.setText(f"Next shot: {localised_text(in_words(diagnosis).separating_shot or ANOTHER_SHOT)}")

    def _add(self, button: QPushButton) -> None:
        self._row.addWidget(button)
        button.show()


UNPLANNED = "These data do not distinguish the candidates. The program can search for a shot that would."

ARM, SET = "ARM for planned shot", "Set bench and take shot"
ARM_TIP = (
    "Set the rig as stated, then arm: the shot joins this diagnosis. Its mass is the block's fitted mass plus the "
    "added masses, so leave the settings unchanged"
)
NORMS = "Noise norm: separation of two models in units of the noise; 5 or more are decisive"
SET_TIP = "The simulated bench is set to this speed and added mass, and pushed; the shot joins this diagnosis"


class NextShotCard(QFrame):
    """The card NEXT SHOT: a sentence, the planned shots so far, buttons; hidden if no candidates are undecided."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        column = vertical(self, (8, 4, 8, 4), 2)
        column.addWidget(heading_label("NEXT SHOT", self))
        self.sentence = added(column, text_label("", self, wrap=True))
        self.sentence.setToolTip(NORMS)
        self.log = added(column, text_label("", self, faint=True, wrap=True))
        row = QHBoxLayout()
        hover = "Predict every shot this rig can take; find the one that separates the models most"
        self.plan = push_button("Plan the deciding shot", hover, self)
        self.take = push_button(ARM, ARM_TIP, self)
        self.give_up = push_button("Cancel planned shot", "Stop waiting for the planned shot", self)
        for button in (self.plan, self.take, self.give_up):
            row.addWidget(button)
        row.addStretch(1)
        column.addLayout(row)
        self.hide()

    def show_standing(
        self, diagnosis: Diagnosis | None, state: PlanningState | None, waited_for: NextShot | None, sets_itself: bool
    ) -> None:
        """Show the plan for a diagnosed set; ``sets_itself``: the program sets speed and weights of this source."""
        left_open = diagnosis is not None and bool(first_indistinguishable(diagnosis))
        self.setVisible(left_open or (state is not None and bool(state.steps)))
        planned = state.plan if state is not None else None
        can_take = planned is not None and planned.settles and waited_for is None
        self.sentence.setText(localised_text(_standing_words(state, waited_for, sets_itself)))
        steps = state.steps if state is not None else ()
        self.log.setText(localised_text("\n".join(_step_line(n, step) for n, step in enumerate(steps, 1))))
        self.log.setVisible(bool(self.log.text()))
        self.plan.setVisible(left_open and state is None and waited_for is None)
        self.take.setVisible(can_take)
        self.take.setText(SET if sets_itself else ARM)
        self.take.setToolTip(SET_TIP if sets_itself else ARM_TIP)
        self.give_up.setVisible(waited_for is not None)


def _standing_words(state: PlanningState | None, waited_for: NextShot | None, sets_itself: bool) -> str:
    if waited_for is not None:
        said = "Being taken" if sets_itself else "Armed. Set, then push"
        return f"{said}: {waited_for.words}"
    if state is None:
        return UNPLANNED
    return state.plan.words if state.plan is not None else "Resolved: one candidate remains."


def _step_line(number: int, step: PlannedStep) -> str:
    reached = "not known" if step.reached is None else f"{step.reached:.2g}"
    return f"{number}. {step.shot.words}: {step.expected_separation:.2g} noise norms expected, {reached} reached"
