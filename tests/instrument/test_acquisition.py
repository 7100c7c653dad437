"""The state machine, exhaustively: every state with every event, every deadline, any order of events."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.capture.acquisition import TABLE, TIMED_OUT, Acquisition, Action, Deadlines, Event, State

# written out by hand a second time: what a person expects of each state; everything else must change nothing
EXPECTED = {
    "idle": {"arm": ("arming", "start"), "fail": ("fault", "stop")},
    "arming": {"started": ("armed", "none"), "abort": ("idle", "stop"), "fail": ("fault", "stop")},
    "armed": {
        "abort": ("idle", "stop"),
        "trigger": ("triggered", "none"),
        "fail": ("fault", "stop"),
        "timeout": ("idle", "stop"),
    },
    "triggered": {
        "abort": ("idle", "keep"),
        "complete": ("transferring", "finish"),
        "fail": ("fault", "keep"),
        "timeout": ("fault", "keep"),
    },
    "transferring": {
        "abort": ("idle", "none"),
        "saved": ("analysing", "none"),
        "fail": ("fault", "stop"),
        "timeout": ("fault", "stop"),
    },
    "analysing": {
        "arm": ("arming", "start"),
        "abort": ("idle", "cancel"),
        "analysed": ("idle", "none"),
        "fail": ("fault", "stop"),
        "timeout": ("fault", "cancel"),
    },
    "fault": {"arm": ("arming", "start"), "abort": ("idle", "none"), "fail": ("fault", "stop")},
}
ROAD = {  # events that lead to each state
    State.IDLE: [],
    State.ARMING: [Event.ARM],
    State.ARMED: [Event.ARM, Event.STARTED],
    State.TRIGGERED: [Event.ARM, Event.STARTED, Event.TRIGGER],
    State.TRANSFERRING: [Event.ARM, Event.STARTED, Event.TRIGGER, Event.COMPLETE],
    State.ANALYSING: [Event.ARM, Event.STARTED, Event.TRIGGER, Event.COMPLETE, Event.SAVED],
    State.FAULT: [Event.FAIL],
}


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def at(state: State, *, automatic: bool = False) -> tuple[Acquisition, Clock]:
    """Return a machine that was led to ``state``."""
    clock = Clock()
    machine = Acquisition(clock)
    for event in ROAD[state]:
        machine.handle(event, automatic=automatic)
    assert machine.status.state is state
    return machine, clock


@pytest.mark.parametrize(("state", "event"), list(itertools.product(State, Event)))
def test_every_state_with_every_event(state: State, event: Event) -> None:
    machine, clock = at(state)
    before = machine.status
    clock.now += 1.0
    action = machine.handle(event, "because", "do this")
    wanted = EXPECTED[state].get(event)
    if wanted is None:
        assert machine.status is before and action is Action.NONE
    else:
        assert (machine.status.state, action) == wanted and machine.status.since_s == 101.0
        if not (state is State.FAULT and event is Event.FAIL):
            assert machine.status.message == "because" and machine.status.remedy == "do this"


def test_the_table_holds_nothing_else() -> None:
    assert {(s, e): v for (s, e), v in TABLE.items()} == {
        (State(s), Event(e)): (State(after), Action(action))
        for s, row in EXPECTED.items()
        for e, (after, action) in row.items()
    }


@pytest.mark.parametrize(
    ("state", "what", "remedy"),
    [
        (State.ARMED, "the light switch did not fire in time", "check its beam"),
        (State.TRIGGERED, "the samples stopped coming", "what came is kept"),
        (State.TRANSFERRING, "the disk takes too long", "the shot stays in memory"),
        (State.ANALYSING, "the analysis took too long", "the recording is saved"),
    ],
)
def test_of_a_wait_that_was_too_long_it_is_said_what_took_it_and_then_what_to_do(
    state: State, what: str, remedy: str
) -> None:
    machine, clock = at(state)
    clock.now += 1e4
    machine.tick()
    assert machine.status.message.startswith(what) and machine.status.remedy.startswith(remedy)


@pytest.mark.parametrize("state", list(State))
def test_every_wait_has_a_deadline(state: State) -> None:
    machine, clock = at(state)
    limit = Deadlines().of(state)
    if state in (State.IDLE, State.ARMING, State.FAULT):  # in ARMING the thread waits for the driver itself
        assert limit is None
        clock.now += 1e9
        assert machine.tick() is Action.NONE
        return
    assert limit is not None
    clock.now += limit - 1e-3
    assert machine.tick() is Action.NONE and machine.status.state is state
    clock.now += 2e-3
    action = machine.tick()
    assert (machine.status.state, action) == EXPECTED[state]["timeout"]
    assert (machine.status.message, machine.status.remedy) == TIMED_OUT[state]
    assert machine.tick() is Action.NONE


def test_automatic_rearms_until_aborted_or_failed() -> None:
    machine, _ = at(State.TRANSFERRING, automatic=True)
    for _ in range(3):
        assert machine.handle(Event.SAVED) is Action.START and machine.status.state is State.ARMING
        machine.handle(Event.STARTED)
        assert machine.status.state is State.ARMED and machine.status.automatic
        machine.handle(Event.TRIGGER)
        machine.handle(Event.COMPLETE)
    machine.handle(Event.ABORT)
    assert machine.status.state is State.IDLE and not machine.status.automatic
    machine.handle(Event.ARM)
    assert not machine.status.automatic
    machine, _ = at(State.TRIGGERED, automatic=True)
    machine.handle(Event.FAIL)
    assert not machine.status.automatic


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("on", [True, False])
def test_a_change_of_mind_about_rearming_holds_for_the_arming_under_way(state: State, on: bool) -> None:
    machine, _ = at(state, automatic=not on and state is not State.ANALYSING)  # a re-arming one never gets there
    before = machine.status
    machine.set_automatic(on)
    if state in (State.ARMED, State.TRIGGERED, State.TRANSFERRING):
        assert machine.status.automatic is on
        for event in (Event.TRIGGER, Event.COMPLETE, Event.SAVED):
            machine.handle(event)
        assert machine.status.state is (State.ARMING if on else State.ANALYSING)
    else:
        assert machine.status is before


def test_the_first_cause_of_a_fault_stays() -> None:
    machine, _ = at(State.ARMED)
    machine.handle(Event.FAIL, "unplugged", "plug it in")
    machine.handle(Event.FAIL, "no such device")
    machine.handle(Event.FAIL, "the disk is full", "save it elsewhere", save_failed=True)
    assert machine.status.message == "unplugged" and machine.status.remedy == "plug it in"
    assert not machine.status.save_failed


def test_a_shot_that_was_not_saved_is_the_fault_until_it_is_left() -> None:
    machine, _ = at(State.TRANSFERRING)
    machine.handle(Event.FAIL, "the disk is full", "save it elsewhere", save_failed=True)
    assert machine.status.save_failed
    machine.handle(Event.FAIL, "unplugged", "plug it in")
    assert machine.status.save_failed  # still the cause
    machine.handle(Event.ABORT)
    assert not machine.status.save_failed


@given(st.lists(st.sampled_from(Event), max_size=40))
def test_abort_leads_to_idle_from_anywhere(events: list[Event]) -> None:
    machine = Acquisition(Clock())
    for event in events:
        machine.handle(event)
    machine.handle(Event.ABORT)
    assert machine.status.state is State.IDLE
    machine.handle(Event.ARM)
    assert machine.status.state is State.ARMING
