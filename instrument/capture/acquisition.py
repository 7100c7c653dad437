"""What the instrument is doing, as a table: every state, every event, every deadline."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType


class State(StrEnum):
    """What the instrument is doing."""

    IDLE = "idle"  # ready; signals may be watched
    ARMED = "armed"  # waiting for the light switch
    TRIGGERED = "triggered"  # it fired; samples of the shot are coming in
    TRANSFERRING = "transferring"  # all samples came; they are brought safely to disk
    ANALYSING = "analysing"  # a single shot is being analysed; arming is possible at any time
    FAULT = "fault"  # something went wrong; the message says what, the remedy what to do


class Event(StrEnum):
    """What may happen to it."""

    ARM = "arm"
    ABORT = "abort"
    TRIGGER = "trigger"
    COMPLETE = "complete"  # the last sample of the shot came
    SAVED = "saved"
    ANALYSED = "analysed"
    FAIL = "fail"
    TIMEOUT = "timeout"  # the deadline of the present state passed


class Action(StrEnum):
    """What has to be done because of it."""

    NONE = "none"
    START = "start"  # arm the digitizer, look for the light switch
    STOP = "stop"  # stop looking; nothing came
    KEEP = "keep"  # end the shot here and save what came
    FINISH = "finish"  # save the whole shot
    CANCEL = "cancel"  # stop the analysis under way


_S, _E, _A = State, Event, Action

# (state, event) -> (next state, action); what is not here changes nothing.  SAVED in automatic mode: see _next.
TABLE: Mapping[tuple[State, Event], tuple[State, Action]] = MappingProxyType(
    {
        (_S.IDLE, _E.ARM): (_S.ARMED, _A.START),
        (_S.IDLE, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ARMED, _E.ABORT): (_S.IDLE, _A.STOP),
        (_S.ARMED, _E.TRIGGER): (_S.TRIGGERED, _A.NONE),
        (_S.ARMED, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ARMED, _E.TIMEOUT): (_S.IDLE, _A.STOP),
        (_S.TRIGGERED, _E.ABORT): (_S.IDLE, _A.KEEP),
        (_S.TRIGGERED, _E.COMPLETE): (_S.TRANSFERRING, _A.FINISH),
        (_S.TRIGGERED, _E.FAIL): (_S.FAULT, _A.KEEP),
        (_S.TRIGGERED, _E.TIMEOUT): (_S.FAULT, _A.KEEP),
        # samples that all came are never thrown away: an abort only ends the waiting, the saving goes on
        (_S.TRANSFERRING, _E.ABORT): (_S.IDLE, _A.NONE),
        (_S.TRANSFERRING, _E.SAVED): (_S.ANALYSING, _A.NONE),
        (_S.TRANSFERRING, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.TRANSFERRING, _E.TIMEOUT): (_S.FAULT, _A.STOP),
        (_S.ANALYSING, _E.ARM): (_S.ARMED, _A.START),
        (_S.ANALYSING, _E.ABORT): (_S.IDLE, _A.CANCEL),
        (_S.ANALYSING, _E.ANALYSED): (_S.IDLE, _A.NONE),
        (_S.ANALYSING, _E.FAIL): (_S.FAULT, _A.STOP),
        (_S.ANALYSING, _E.TIMEOUT): (_S.FAULT, _A.CANCEL),
        (_S.FAULT, _E.ARM): (_S.ARMED, _A.START),
        (_S.FAULT, _E.ABORT): (_S.IDLE, _A.NONE),
        (_S.FAULT, _E.FAIL): (_S.FAULT, _A.STOP),
    }
)

# what a person reads when a deadline passes: (what happened, what to do)
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
    """The longest wait in each state without any progress, in s."""

    armed_s: float = 3600.0
    triggered_s: float = 60.0
    transferring_s: float = 60.0
    analysing_s: float = 120.0

    def of(self, state: State) -> float | None:
        """Return the longest wait in ``state``; None where nothing is waited for."""
        waits = {
            _S.ARMED: self.armed_s,
            _S.TRIGGERED: self.triggered_s,
            _S.TRANSFERRING: self.transferring_s,
            _S.ANALYSING: self.analysing_s,
        }
        return waits.get(state)


@dataclass(frozen=True, slots=True)
class Status:
    """The present state, for anyone to read; times are those of the injected clock, in s."""

    state: State
    since_s: float
    deadline_s: float | None
    automatic: bool = False
    message: str = ""
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Transition:
    """What an event led to; ``accepted`` is False where it meant nothing in that state."""

    before: State
    after: State
    action: Action
    accepted: bool


@dataclass(slots=True)
class Acquisition:
    """The state machine.  Used from one thread; ``status`` may be read from any."""

    clock: Callable[[], float]
    deadlines: Deadlines = field(default_factory=Deadlines)
    status: Status = field(init=False)
    _last_s: float = field(init=False)

    def __post_init__(self) -> None:
        self._last_s = self.clock()
        self.status = Status(State.IDLE, self._last_s, None)

    def handle(self, event: Event, message: str = "", remedy: str = "", *, automatic: bool = False) -> Transition:
        """Take an event.  ``automatic`` goes with ARM: re-arm by itself after each shot until aborted."""
        before = self.status
        entry = self._next(event)
        if entry is None:
            return Transition(before.state, before.state, Action.NONE, False)
        state, action = entry
        now = self.clock()
        self._last_s = now
        going_on = before.automatic and state not in (State.IDLE, State.FAULT)
        rearm = automatic if event is Event.ARM else going_on
        if event is Event.FAIL and before.state is State.FAULT:
            message, remedy = before.message or message, before.remedy or remedy  # the first cause is the cause
        limit = self.deadlines.of(state)
        self.status = Status(state, now, None if limit is None else now + limit, rearm, message, remedy)
        return Transition(before.state, state, action, True)

    def set_automatic(self, on: bool) -> None:
        """Let the present arming re-arm by itself, or end with its shot; without one, or after its shot, nothing."""
        if self.status.state in (State.ARMED, State.TRIGGERED, State.TRANSFERRING):
            self.status = replace(self.status, automatic=on)

    def progressed(self) -> None:
        """Begin the wait of the present state anew: what it waits for is on its way."""
        limit = self.deadlines.of(self.status.state)
        if limit is not None:
            self.status = replace(self.status, deadline_s=self.clock() + limit)

    def tick(self) -> Transition | None:
        """Take the event TIMEOUT where the deadline has passed; call often."""
        now = self.clock()
        status = self.status
        if now < self._last_s and status.deadline_s is not None:
            # a clock that ran backwards must not lengthen a wait
            back = self._last_s - now
            status = replace(status, since_s=status.since_s - back, deadline_s=status.deadline_s - back)
            self.status = status
        self._last_s = now
        if status.deadline_s is None or now < status.deadline_s:
            return None
        message, remedy = TIMED_OUT[status.state]
        return self.handle(Event.TIMEOUT, message, remedy)

    def _next(self, event: Event) -> tuple[State, Action] | None:
        status = self.status
        if status.state is State.TRANSFERRING and event is Event.SAVED and status.automatic:
            return State.ARMED, Action.START  # the analysis goes on behind
        return TABLE.get((status.state, event))
