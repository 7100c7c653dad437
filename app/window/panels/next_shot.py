"""The card NEXT SHOT: which shot decides between the candidates, and the buttons that plan and take it."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from analysis.diagnosis import Diagnosis
from analysis.planning import NextShot, PlannedStep, PlanningState, undecided
from app.window.widgets import push_button, text_label
from app.words import local_words

UNPLANNED = (
    "These data do not decide between the candidates. The program can find the shot that would, if there is one."
)

ARM, SET = "ARM for it", "Set and take it"
ARM_TIP = (
    "Set the rig as said, then arm: the shot joins this diagnosis. Its mass is that of the block as found with the "
    "weights added, so leave the settings as they are"
)
NORMS = "Noise norm: the distance between two models in units of the noise; five or more decide"
SET_TIP = "The simulated bench is set to this speed and weight, and pushed; the shot joins this diagnosis"


class NextShotCard(QFrame):
    """A sentence, the planned shots so far, and buttons; hidden where nothing is open."""

    plan_wanted = Signal()
    take_wanted = Signal()
    give_up_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 4, 8, 4)
        column.setSpacing(2)
        heading = text_label("NEXT SHOT", self, heading=True)
        column.addWidget(heading)
        self._sentence = text_label("", self, wrap=True)
        self._sentence.setToolTip(NORMS)
        column.addWidget(self._sentence)
        self._log = text_label("", self, faint=True, wrap=True)
        column.addWidget(self._log)
        row = QHBoxLayout()
        self.plan = QPushButton("Plan the deciding shot", self)
        self.plan.setToolTip("Predict every shot this rig can take; find the one that separates the models best")
        self.take = QPushButton(ARM, self)
        self.take.setToolTip(ARM_TIP)
        self.give_up = push_button("Give up", "Stop waiting for the planned shot", self)
        for button in (self.plan, self.take, self.give_up):
            row.addWidget(button)
        row.addStretch(1)
        column.addLayout(row)
        self.plan.clicked.connect(self.plan_wanted)
        self.take.clicked.connect(self.take_wanted)
        self.give_up.clicked.connect(self.give_up_wanted)
        self.hide()

    @property
    def words(self) -> str:
        """Get the sentence on the next shot."""
        return self._sentence.text()

    @property
    def log_words(self) -> str:
        """Get the lines on the planned shots so far."""
        return self._log.text()

    def show_standing(
        self, diagnosis: Diagnosis | None, state: PlanningState | None, waited_for: NextShot | None, sets_itself: bool
    ) -> None:
        """Show the plan for a diagnosed set; ``sets_itself``: the program sets speed and weights at this source."""
        left_open = diagnosis is not None and bool(undecided(diagnosis))
        self.setVisible(left_open or (state is not None and bool(state.steps)))
        planned = state.plan if state is not None else None
        can_take = planned is not None and planned.settles and waited_for is None
        if waited_for is not None:
            said = "Being taken" if sets_itself else "Armed. Set, then push"
            self._sentence.setText(local_words(f"{said}: {waited_for.words}"))
        elif state is None:
            self._sentence.setText(UNPLANNED)
        else:
            words = planned.words if planned is not None else "Resolved: one candidate remains."
            self._sentence.setText(local_words(words))
        steps = state.steps if state is not None else ()
        self._log.setText(local_words("\n".join(_line(n, step) for n, step in enumerate(steps, 1))))
        self._log.setVisible(bool(self._log.text()))
        self.plan.setVisible(left_open and state is None and waited_for is None)
        self.take.setVisible(can_take)
        self.take.setText(SET if sets_itself else ARM)
        self.take.setToolTip(SET_TIP if sets_itself else ARM_TIP)
        self.give_up.setVisible(waited_for is not None)

    def enable_plan(self, on: bool) -> None:
        """Enable the button that plans."""
        self.plan.setEnabled(on)


def _line(number: int, step: PlannedStep) -> str:
    reached = "not known" if step.reached is None else f"{step.reached:.2g}"
    return f"{number}. {step.shot.words}: {step.expected_separation:.2g} noise norms expected, {reached} reached"
