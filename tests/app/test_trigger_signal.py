"""The trigger is signalled once a shot, whichever states of it the screen happens to see."""

from types import SimpleNamespace

import pytest

from app.window.presenters.rig import RigPresenter
from instrument.capture.acquisition import State

IDLE, ARMED, TRIGGERED = State.IDLE, State.ARMED, State.TRIGGERED
TRANSFERRING, ANALYSING = State.TRANSFERRING, State.ANALYSING


@pytest.mark.parametrize(
    ("looks", "times"),
    [
        ([(IDLE, 0), (ARMED, 0), (TRIGGERED, 0), (TRANSFERRING, 0), (ANALYSING, 1), (IDLE, 1)], 1),
        ([(IDLE, 0), (ARMED, 0), (TRANSFERRING, 0), (ANALYSING, 1)], 1),
        ([(IDLE, 0), (ARMED, 0), (ANALYSING, 1)], 1),
        ([(IDLE, 0), (ANALYSING, 1), (IDLE, 1)], 1),  # a busy machine sees nothing of it but its end
        ([(ARMED, 0), (TRIGGERED, 0), (ARMED, 1), (TRIGGERED, 1), (ARMED, 2)], 2),
        ([(IDLE, 0), (ARMED, 0), (IDLE, 0)], 0),
    ],
)
def test_each_shot_is_signalled_once(looks, times):
    flashed = []
    rig = SimpleNamespace(
        _before=looks[0],
        _store=SimpleNamespace(settings=SimpleNamespace(sound=False, flash=True)),
        _panels=SimpleNamespace(banner=SimpleNamespace(flash=lambda: flashed.append(1))),
    )
    for state, shots in looks[1:]:
        RigPresenter._signal_trigger(rig, SimpleNamespace(state=state, shots=shots))
    assert len(flashed) == times
