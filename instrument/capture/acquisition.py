"""The state machine of a capture: its states, events and deadlines, and the table of transitions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType


class State(StrEnum):
    """The state of the instrument."""

    IDLE = "idle"  # ready; signals may be watched
    ARMING = "arming"  # the digitizer is being started, which may take seconds; a shot now would be missed
    ARMED = "armed"  # waiting for the light switch
    TRIGGERED = "triggered"  # the light switch fired; the samples of the shot are being received
    TRANSFERRING = "transferring"  # all samples were received; they are being written to disk
    ANALYSING = "analysing"  # a single shot is being analysed; arming is possible at any time
    FAULT = "fault"  # something went wrong; the message says what, the remedy what to do


class Event(StrEnum):
    """An event that can change the state."""

    ARM = "arm"
    STARTED = "started"  # the digitizer delivers samples, or waits for its own trigger
    ABORT = "abort"
    TRIGGER = "trigger"
    COMPLETE = "complete"  # the last sample of the shot was received
    SAVED = "saved"
    ANALYSED = "analysed"
    FAIL = "fail"
    TIMEOUT = "timeout"  # the deadline of the present state passed


class Action(StrEnum):
    """An action that a transition requires."""

    NONE = "none"
    START = "start"  # arm the digitizer, look for the light switch
    STOP = "stop"  # stop looking; no sample of a shot was received
    KEEP = "keep"  # end the shot here and save what was received
    FINISH = "finish"  # save the whole shot
    CANCEL = "cancel"  # stop the analysis under way


_S, _E, _A = State, Event, Action

# (state, event) -> (next state, action); an unlisted pair changes nothing.  _next handles SAVED with automatic on.
TABLE: Mapping[tuple[State, Event], tuple[State, Action]] = MappingProxyType(
    {
        (_S.IDLE, _E.ARM): (_S.ARMING, _A.START),
        (_S.IDLE, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ARMING, _E.STARTED): (_S.ARMED, _A.NONE),
        (_S.ARMING, _E.ABORT): (_S.IDLE, _A.STOP),
        (_S.ARMING, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ARMED, _E.ABORT): (_S.IDLE, _A.STOP),
        (_S.ARMED, _E.TRIGGER): (_S.TRIGGERED, _A.NONE),
        (_S.ARMED, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ARMED, _E.TIMEOUT): (_S.IDLE, _A.STOP),
        (_S.TRIGGERED, _E.ABORT): (_S.IDLE, _A.KEEP),
        (_S.TRIGGERED, _E.COMPLETE): (_S.TRANSFERRING, _A.FINISH),
        (_S.TRIGGERED, _E.FAIL): (_S.FAULT, _A.KEEP),
        (_S.TRIGGERED, _E.TIMEOUT): (_S.FAULT, _A.KEEP),
        # a complete shot is never discarded: an abort only ends the waiting, and saving continues
        (_S.TRANSFERRING, _E.ABORT): (_S.IDLE, _A.NONE),
        (_S.TRANSFERRING, _E.SAVED): (_S.ANALYSING, _A.NONE),
        (_S.TRANSFERRING, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.TRANSFERRING, _E.TIMEOUT): (_S.FAULT, _A.STOP),
        (_S.ANALYSING, _E.ARM): (_S.ARMING, _A.START),
        (_S.ANALYSING, _E.ABORT): (_S.IDLE, _A.CANCEL),
        (_S.ANALYSING, _E.ANALYSED): (_S.IDLE, _A.NONE),
        (_S.ANALYSING, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ANALYSING, _E.TIMEOUT): (_S.FAULT, _A.CANCEL),
        (_S.FAULT, _E.ARM): (_S.ARMING, _A.START),
        (_S.FAULT, _E.ABORT): (_S.IDLE, _A.NONE),
        (_S.FAULT, _E.FAIL): (_S.FAULT, _A.STOP),
    }
)

CAN_ARM = frozenset(state for state, event in TABLE if event is Event.ARM)

# the message when a deadline passes: (what happened, what to do)
TIMED_OUT: Mapping[State, tuple[str, str]] = MappingProxyType(
    {
        _S.ARMED: ("the light switch did not fire in time", "check its beam and its channel, then arm again"),
        _S.TRIGGERED: ("the samples stopped coming", "what came is kept; check the digitizer, then arm again"),
        _S.TRANSFERRING: ("the disk takes too long", "the shot stays in memory; save it elsewhere"),
        _S.ANALYSING: ("the analysis took too long and was stopped", "the recording is saved; analyse it again"),
    }
)


@dataclass(frozen=True, slots=True)
class Deadlines:
    """The longest wait without progress in each state, in s; each field is named after its state."""

    armed_s: float = 3600.0
    triggered_s: float = 60.0
    transferring_s: float = 60.0
    analysing_s: float = 120.0

    def of(self, state: State) -> float | None:
        """Return the longest wait in ``state``; None for a state without a deadline."""
        return getattr(self, f"{state}_s", None)


@dataclass(frozen=True, slots=True)
class Status:
    """The present state; times are those of the machine's clock, in s."""

    state: State
    since_s: float
    deadline_s: float | None
    automatic: bool = False
    message: str = ""
    remedy: str = ""
    save_failed: bool = False  # True: the fault is that a shot could not be saved


@dataclass(slots=True)
class Acquisition:
    """The state machine; used from one thread, ``status`` may be read from any."""

    clock: Callable[[], float]
    deadlines: Deadlines = field(default_factory=Deadlines)
    status: Status = field(init=False)

    def __post_init__(self) -> None:
        self.status = Status(State.IDLE, self.clock(), None)

    def handle(
        self, event: Event, message: str = "", remedy: str = "", *, automatic: bool = False, save_failed: bool = False
    ) -> Action:
        """Process an event; return the required action.

        ``automatic``, with ARM only: re-arm after each shot; ``save_failed``, with FAIL only: a shot was not saved.
        """
        before = self.status
        entry = self._next(event)
        if entry is None:
            return Action.NONE
        state, action = entry
        now = self.clock()
        still_automatic = before.automatic and state not in (State.IDLE, State.FAULT)
        rearm = automatic if event is Event.ARM else still_automatic
        if event is Event.FAIL and before.state is State.FAULT:
            save_failed = before.save_failed if before.remedy else save_failed
            message, remedy = before.message or message, before.remedy or remedy  # the first fault is the cause
        limit = self.deadlines.of(state)
        self.status = Status(state, now, None if limit is None else now + limit, rearm, message, remedy, save_failed)
        return action

    def set_automatic(self, on: bool) -> None:
        """Set whether to re-arm after the present shot; no effect unless armed, triggered or transferring."""
        if self.status.state in (State.ARMED, State.TRIGGERED, State.TRANSFERRING):
            self.status = replace(self.status, automatic=on)

    def progressed(self) -> None:
        """Restart the deadline of the present state, because the awaited work has progressed."""
        limit = self.deadlines.of(self.status.state)
        if limit is not None:
            self.status = replace(self.status, deadline_s=self.clock() + limit)

    def tick(self) -> Action:
        """Process TIMEOUT if the deadline has passed; return the required action.  Call often."""
        status = self.status
        if status.deadline_s is None or self.clock() < status.deadline_s:
            return Action.NONE
        message, remedy = TIMED_OUT[status.state]
        return self.handle(Event.TIMEOUT, message, remedy)

    def _next(self, event: Event) -> tuple[State, Action] | None:
        status = self.status
        if status.state is State.TRANSFERRING and event is Event.SAVED and status.automatic:
            return State.ARMING, Action.START  # the analysis goes on in its own thread
        return TABLE.get((status.state, event))
